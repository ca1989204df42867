"""Figures of the light: distance, further bounces, mirrors and panes, motion."""

from __future__ import annotations

import math

import numpy as np
import torch

from figures.stage import (
    BLUE,
    CAMERA,
    GRAY,
    GREEN,
    INTEGRATION_S,
    MIDDLE,
    PER_RADIAN_M,
    POWER_W,
    RED,
    SENSOR,
    SINE,
    Made,
    Row,
    acquired,
    apart_m,
    axes,
    floor,
    label,
    light_of,
    moving,
    phase_of,
    plate,
    rendered,
    show,
    wall,
    wall_return,
    world,
)
from shotenv.sensor import Exposure, electrons_per_radiance_second
from shotenv.world.geometry.meshes import join
from unwrap.signal import TWO_PI, Shots, decode, distance_m, unambiguous_range_m


def _wrapped_m(correlation: np.ndarray) -> np.ndarray:
    """Distance of noise-free samples [2 or 4, H, W], metres."""
    return distance_m(decode(torch.from_numpy(correlation)).phase_rad, SENSOR.f1_hz).numpy()


def signal() -> Made:
    """Amplitude of a rendered wall over its distance."""
    figure, (panel,) = axes("A wall straight ahead: 7 W, 600 µs")
    distances = np.geomspace(0.6, 25.0, 9)
    per_radiance = SENSOR.gain_lsb_per_e * SENSOR.contrast * POWER_W * INTEGRATION_S
    per_radiance *= electrons_per_radiance_second(SENSOR)
    found = {}
    for albedo, colour in ((0.8, BLUE), (0.4, GREEN), (0.1, RED)):
        for distance in distances:
            frame = rendered(world(wall(distance, albedo=albedo)))
            maps = (frame.correlation, frame.active, frame.ambient, frame.distance_m)
            exposure = Exposure(*(torch.from_numpy(values)[None] for values in maps))
            raw = acquired(exposure)
            # A full well cuts the amplitude off: of near bright walls there is no point to draw.
            if not raw.saturated[0][MIDDLE]:
                found[albedo, distance] = float(decode(raw.dcs_lsb).amplitude[0][MIDDLE])
        mine = [(d, a) for (one, d), a in found.items() if one == albedo]
        panel.plot(*zip(*mine, strict=True), "o", color=colour, label=f"albedo {albedo:g}")
        fine = np.geomspace(0.6, 25.0, 100)
        panel.plot(fine, per_radiance * wall_return(fine, albedo), "-", color=colour, lw=1)
    noise_lsb = SENSOR.gain_lsb_per_e * SENSOR.read_noise_e * math.sqrt(2)
    panel.axhline(noise_lsb, color=GRAY, ls="--", label="read noise of a sample")
    panel.set(xscale="log", yscale="log", xticks=[0.6, 1, 2, 5, 10, 25])
    panel.set_xticklabels(["0.6", "1", "2", "5", "10", "25"])
    panel.minorticks_off()
    label(panel, "distance, m", "amplitude, LSB")
    near, far = distances[2], distances[4]
    fall, expected = found[0.8, near] / found[0.8, far], (far / near) ** 2
    return figure, [
        Row(
            f"amplitude at {near:.2f} m over that at {far:.2f} m",
            f"{expected:.3f}",
            f"{fall:.3f}",
        )
    ]


def multipath() -> Made:
    """Distance error in an inner corner of two walls."""
    camera = CAMERA.model_copy(
        update={"width": 48, "height": 36, "samples_per_pixel": 256, "bounces": 4}
    )
    half = 2.5 / math.sqrt(2)  # two sides of 5 m at right angles, turned by 45 degrees
    figure, panels = axes(
        "Error, albedo 0.8, 3 further bounces", "Mean of the middle rows", widths=(1, 1.1)
    )
    columns = np.arange(camera.width)
    for albedo, colour in ((0.2, GREEN), (0.5, BLUE), (0.8, RED)):
        sides = [
            plate((3.5, s * half, 1.0), (half, -s * half, 0), (0, 0, 3.0), albedo=albedo)
            for s in (1, -1)
        ]
        frame = rendered(world(join(sides)), camera)
        measured_m = _wrapped_m(frame.correlation[:4])
        error_mm = 1e3 * apart_m(measured_m, frame.distance_m, unambiguous_range_m(SENSOR.f1_hz))
        middle = slice(camera.height // 2 - 2, camera.height // 2 + 2)
        panels[1].plot(
            columns, error_mm[middle].mean(axis=0), color=colour, label=f"albedo {albedo:g}"
        )
    show(figure, panels[0], error_mm, "measured minus true, mm", vmin=0)
    panels[1].set_ylim(0, 260)
    label(panels[1], "column", "measured minus true, mm", loc="upper right")
    return figure, []


def panes() -> Made:
    """A dusty pane before a wall, and a wet floor."""
    figure, panels = axes("A pane at 2 m before a wall at 5 m", "A wet floor before a wall at 5 m")
    camera = CAMERA.model_copy(update={"samples_per_pixel": 1024, "bounces": 2})
    shares = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0])
    found = []
    for share in shares:
        dusty = wall(2.0, clear=1 - share)
        frame = rendered(world(join([wall(5.0), dusty])), camera)
        found.append(float(_wrapped_m(frame.correlation[:4])[MIDDLE]))
    fine = np.linspace(0, 1, 200)
    expected = _behind_glass_m(fine)
    panels[0].plot(fine, expected, "-", color=GRAY, lw=1, label="sum of both returns")
    panels[0].plot(shares, found, "o", color=BLUE, label="rendered")
    label(panels[0], "share of the light that the dust scatters", "measured distance, m")
    _wet_floor(panels[1])
    apart = 1e3 * np.abs(np.array(found) - _behind_glass_m(shares)).max()
    return figure, [
        Row(
            "wall at 5 m behind a pane at 2 m with 10 % dust, measured distance",
            f"{_behind_glass_m(np.array(0.1)):.3f} m",
            f"{found[3]:.3f} m",
        ),
        Row("largest difference over all shares of dust", "0 mm", f"{apart:.0f} mm (Monte Carlo)"),
    ]


def _behind_glass_m(share):
    """Distance of share x glass + (1 - share)^2 x wall, phasors at f1."""
    glass, behind = (wall_return(d) * np.exp(1j * phase_of(d, SENSOR.f1_hz)) for d in (2.0, 5.0))
    total = share * glass + (1 - share) ** 2 * behind
    return np.remainder(np.angle(total), TWO_PI) * PER_RADIAN_M


def _wet_floor(panel) -> None:
    """Distance down the middle column for several mirrored shares."""
    camera = CAMERA.model_copy(
        update={"width": 33, "height": 33, "samples_per_pixel": 512, "bounces": 3}
    )
    rows, column = np.arange(camera.height), camera.width // 2
    for share, colour in ((0.0, GREEN), (0.3, BLUE), (0.9, RED)):
        scene = world(join([wall(5.0), floor(mirror=share)]))
        frame = rendered(scene, camera)
        measured = _wrapped_m(frame.correlation[:4])[:, column]
        panel.plot(measured, rows, ".-", color=colour, lw=0.8, label=f"{share:.0%} mirrored")
    panel.plot(frame.distance_m[:, column], rows, "--", color=GRAY, label="true")
    panel.invert_yaxis()
    label(panel, "distance, m", "row of the image", loc="upper left")


def motion() -> Made:
    """A wall that comes nearer, and an edge that passes."""
    figure, panels = axes("Wall coming at 6 m/s", "Edge passing at 60 m/s", widths=(1.3, 1))
    speed_m_s, distances = 6.0, np.linspace(7.0, 12.5, 15)
    # The renderer wants something that stands still; nobody sees it.
    buried = plate((0, 0, -50), (1, 0, 0), (0, 1, 0))
    worst_m = 0.0
    found = {2: [], 4: []}
    for distance in distances:
        coming = moving(wall(0.0), (distance, 0.0, 0.0), math.pi, speed_m_s)
        frame = rendered(world(buried, coming))
        for count, errors in found.items():
            measured = _wrapped_m(frame.correlation[:count])[MIDDLE]
            errors.append(float(apart_m(measured, distance, unambiguous_range_m(SENSOR.f1_hz))))
    fine = np.linspace(7.0, 12.5, 300)
    for count, colour in ((4, BLUE), (2, RED)):
        panels[0].plot(fine, 1e3 * motion_error_m(fine, speed_m_s, count), color=colour, lw=1)
        errors = 1e3 * np.array(found[count])
        panels[0].plot(distances, errors, "o", ms=4, color=colour, label=f"{count} DCS, rendered")
        expected = motion_error_m(distances, speed_m_s, count)
        worst_m = max(worst_m, np.abs(np.array(found[count]) - expected).max())
    panels[0].plot([], [], color=GRAY, lw=1, label="closed form")
    panels[0].set_ylim(-60, 35)
    label(panels[0], "distance at the first sample, m", "error, mm", ncols=2, loc="upper center")
    _passing_edge(figure, panels[1])
    return figure, [
        Row(
            "motion error at 6 m/s: largest difference from the closed form, 2 and 4 DCS",
            "0 mm (to first order in the speed)",
            f"{1e3 * worst_m:.2f} mm",
        )
    ]


def motion_error_m(distance, speed_m_s: float, count: int):
    """Measured minus true distance at the first sample, of 2 or 4 DCS of an oncoming wall.

    The mean time of the samples, and h cos 2a + e sin 2a about it.
    """
    step_m = -speed_m_s * SENSOR.sample_period_s
    mean_m = distance + (count - 1) / 2 * step_m
    a, h = phase_of(mean_m, SENSOR.f1_hz), phase_of(step_m, SENSOR.f1_hz) / 2
    error_rad = h * np.cos(2 * a) - step_m / distance * np.sin(2 * a)
    return mean_m - distance + PER_RADIAN_M * error_rad


def _passing_edge(figure, panel) -> None:
    """What opposite samples fail to cancel where an edge passes."""
    camera = CAMERA.model_copy(update={"width": 48, "height": 36})
    shutter = plate((0, 0, 0), (5.0, 0, 0), (0, 0, 0.8))
    edge = moving(shutter, (4.0, -4.7, 1.0), math.pi / 2, 60.0)
    frame = rendered(world(wall(9.0), edge), camera)
    maps = (frame.correlation, frame.active, frame.ambient, frame.distance_m)
    raw = acquired(Exposure(*(torch.from_numpy(values)[None] for values in maps)))
    residual = decode(raw.dcs_lsb).residual
    assert residual is not None
    show(figure, panel, residual[0].numpy(), "|D0 + D2| or |D1 + D3|, LSB", cmap="magma")


def samples() -> Made:
    """Four samples over distance, and what two frequencies make of them."""
    figure, panels = axes("Four samples at 24 MHz", "Decoded distance")
    true_m = torch.linspace(0.0, 16.0, 1601)[None]
    raw = acquired(light_of(SINE, true_m, torch.full_like(true_m, 0.02)), SINE, Shots.EIGHT)
    for k, colour in enumerate((BLUE, RED, GREEN, GRAY)):
        panels[0].plot(true_m[0], raw.dcs_lsb[0, k, 0], color=colour, label=f"D{k}")
    panels[0].set_xlim(0, 8)
    label(panels[0], "distance, m", "sample, LSB", ncols=4, loc="upper center")
    panels[0].set_ylim(-260, 330)
    errors = []
    for start, hz, colour in ((4, SENSOR.f2_hz, RED), (0, SENSOR.f1_hz, BLUE)):
        frame = decode(raw.dcs_lsb[:, start : start + 4])
        wrapped = distance_m(frame.phase_rad, hz)[0, 0].numpy()
        range_m = unambiguous_range_m(hz)
        panels[1].plot(true_m[0], wrapped, ".", ms=1.5, color=colour, label=f"{hz / 1e6:g} MHz")
        panels[1].axhline(range_m, color=colour, ls=":", lw=0.8)
        error = apart_m(wrapped, true_m[0].numpy(), range_m)
        amplitude = float(frame.amplitude.mean())
        # Each of two quadratures is rounded to half an LSB at most, as a mean of two samples.
        bound_m = range_m / TWO_PI * math.sqrt(0.5) / float(frame.amplitude.min())
        errors.append(
            Row(
                f"largest error without noise, {hz / 1e6:g} MHz, 4 DCS of {amplitude:.0f} LSB",
                f"≤ {1e3 * bound_m:.1f} mm (rounding)",
                f"{1e3 * np.abs(error).max():.1f} mm",
            )
        )
    label(panels[1], "distance, m", "wrapped distance, m", markerscale=6)
    return figure, errors
