"""Figures of the imager: noise, limits, fixed pattern, temperature, gray image."""

from __future__ import annotations

import math

import numpy as np
import torch
from matplotlib.axes import Axes

from figures.stage import (
    BLUE,
    CAMERA,
    GRAY,
    GREEN,
    PER_RADIAN_M,
    RED,
    SENSOR,
    SINE,
    Made,
    Row,
    acquired,
    active_of,
    ambient_of,
    apart_m,
    axes,
    label,
    light_of,
    moving,
    plate,
    rendered,
    show,
    world,
)
from shotenv.config.reader import merged
from shotenv.sensor import (
    Purpose,
    capture_gray,
    draw_offsets,
    electrons_per_radiance_second,
    gray_gain_lsb_per_e,
    residual_drift_m,
    stream,
)
from shotenv.sensor.drift import distance_drift_m
from shotenv.sensor.noise import draw_noise
from unwrap.signal import Shots, decode, distance_m, unambiguous_range_m
from unwrap.signal.wiggle import shifted


def photon_transfer() -> Made:
    """Variance over mean of one sample, from dark to bright."""
    figure, (panel,) = axes("Photon transfer: 100 000 pixels at each level")
    # Fine steps and no full well: rounding and clipping would add to and take from the variance.
    fine = merged(SINE, {"gain_lsb_per_e": 0.1, "adc_bits": 16, "full_well_e": 1e7})
    gain, shape, means, variances = fine.gain_lsb_per_e, (250, 400), [], []
    for level, signal_e in enumerate(np.geomspace(300, 1e5, 12)):
        still = light_of(fine, torch.zeros(shape), torch.full(shape, active_of(signal_e)))
        noise = draw_noise(21, level, 4, *shape)[None]
        dcs = acquired(still, fine, noise=noise).dcs_lsb.double()
        # At distance 0 the opposite sample is -D0: both tell its mean.
        means.append(float((dcs[:, 0] - dcs[:, 2]).mean() / 2))
        variances.append(float(dcs.var(dim=(2, 3)).mean()))
    mean, variance = np.array(means), np.array(variances)
    read = 2 * (gain * fine.read_noise_e) ** 2
    x = np.geomspace(mean[0], mean[-1], 200)
    panel.plot(x, gain * x / fine.contrast + read, color=GRAY, lw=1, label="g D/m + 2 g² σᵣ²")
    panel.plot(x, gain * x / fine.contrast, ":", color=RED, label="shot noise alone")
    panel.axhline(read, color=GREEN, ls=":", label="read noise alone")
    panel.plot(mean, variance, "o", color=BLUE, label="measured")
    panel.set(xscale="log", yscale="log")
    label(panel, "mean of D0, LSB", "variance, LSB²")
    # Weighted by 1 / variance, since the variance's own error is proportional to it.
    design = np.stack([mean, np.ones_like(mean)], axis=1) / variance[:, None]
    (slope, dark), *_ = np.linalg.lstsq(design, np.ones_like(mean), rcond=None)
    return figure, [
        Row(
            "gain from the slope of photon transfer",
            f"{gain:.4f} LSB/e",
            f"{slope * fine.contrast:.4f} LSB/e",
        ),
        Row(
            "read noise of a tap from its intercept",
            f"{fine.read_noise_e:.1f} e",
            f"{math.sqrt(dark / 2) / gain:.1f} e",
        ),
    ]


def depth_noise() -> Made:
    """Standard deviation of distance over signal, for two and four samples."""
    figure, (panel,) = axes(
        "Depth noise at 24 MHz, ambient light of 60 000 e: 60 000 pixels a point"
    )
    rows, ambient_e, shape = [], 6e4, (200, 300)
    signals = np.geomspace(3e3, 1e5, 9)
    for shots, share, colour in ((Shots.TWO, 1.0, RED), (Shots.FOUR, 0.5, BLUE)):
        found = [_depth_std_m(shots, signal_e, ambient_e, shape) for signal_e in signals]
        expected = [depth_noise_m(share, signal_e, ambient_e) for signal_e in signals]
        panel.plot(signals, 1e3 * np.array(expected), color=colour, lw=1)
        name = f"{int(shots)} DCS, Monte Carlo"
        panel.plot(signals, 1e3 * np.array(found), "o", color=colour, label=name)
        rows.append(
            Row(
                f"depth noise, {int(shots)} DCS, S = {signals[4]:.0f} e, B = {ambient_e:.0f} e",
                f"{1e3 * expected[4]:.2f} mm",
                f"{1e3 * found[4]:.2f} mm",
            )
        )
    panel.plot([], [], color=GRAY, lw=1, label="formula")
    panel.set(xscale="log", yscale="log", yticks=[2, 5, 10, 20, 50, 100])
    panel.set_yticklabels(["2", "5", "10", "20", "50", "100"])
    label(panel, "signal S over both taps, electrons", "standard deviation of distance, mm")
    return figure, rows


def depth_noise_m(share: float, signal_e: float, ambient_e: float) -> float:
    """c / (4 pi f) sqrt(share V) / (m S), V = S + B + 2 sigma_r^2."""
    variance = signal_e + ambient_e + 2 * SENSOR.read_noise_e**2
    return PER_RADIAN_M * math.sqrt(share * variance) / (SENSOR.contrast * signal_e)


def _depth_std_m(shots: Shots, signal_e: float, ambient_e: float, shape) -> float:
    maps = torch.full(shape, 3.7), torch.full(shape, active_of(signal_e))
    still = light_of(SINE, *maps, ambient=ambient_of(ambient_e))
    noise = draw_noise(3, int(signal_e), int(shots), *shape)[None]
    raw = acquired(still, SINE, shots, noise=noise)
    return float(distance_m(decode(raw.dcs_lsb).phase_rad, SINE.f1_hz).double().std())


def full_well() -> Made:
    """A sample over the light, until its taps are full."""
    figure, (panel, noise) = axes("D0 at distance 0", "Its noise about a full tap")
    signals = np.linspace(0, 1.6e6, 1601)
    rows = []
    for ambient_e, colour in ((0.0, BLUE), (1e5, RED)):
        maps = torch.zeros(1, len(signals)), torch.tensor([[active_of(s) for s in signals]])
        raw = acquired(light_of(SINE, *maps, ambient=ambient_of(ambient_e)), SINE)
        dcs, full = raw.dcs_lsb[0, 0, 0].numpy(), raw.saturated[0, 0].numpy()
        name = f"ambient {ambient_e / 1e3:g} ke"
        panel.plot(signals[~full] / 1e3, dcs[~full], color=colour, lw=2, label=name)
        panel.plot(signals[full] / 1e3, dcs[full], ":", color=colour, label=f"{name}, flagged")
        limit = (2 * SENSOR.full_well_e - ambient_e) / (1 + SENSOR.contrast)
        rows.append(
            Row(
                f"signal that fills a tap, ambient {ambient_e / 1e3:g} ke",
                f"{limit / 1e3:.1f} ke",
                f"{signals[full][0] / 1e3:.1f} ke (grid of {signals[1] / 1e3:.1f} ke)",
            )
        )
    label(panel, "signal S over both taps, 1000 electrons", "D0, LSB")
    rows.append(_noise_about_a_full_tap(noise))
    return figure, rows


def _noise_about_a_full_tap(panel: Axes) -> Row:
    """Deviation of D0 over the charge of tap A, and of two Poisson taps that are cut off, read."""
    shape, well_e, read_e = (200, 500), SENSOR.full_well_e, SENSOR.read_noise_e
    shares, random, found, expected = (
        np.linspace(0.985, 1.015, 25),
        np.random.default_rng(5),
        [],
        [],
    )
    for level, share in enumerate(shares):
        signal_e = 2 * share * well_e / (1 + SENSOR.contrast)
        still = light_of(SINE, torch.zeros(shape), torch.full(shape, active_of(signal_e)))
        noise = draw_noise(22, level, 2, *shape)[None]
        dcs = acquired(still, SINE, Shots.TWO, noise=noise).dcs_lsb[0, 0].double()
        found.append(float(dcs.std()) / SENSOR.gain_lsb_per_e)
        taps = [
            np.minimum(random.poisson(signal_e / 2 * (1 + sign * SENSOR.contrast), shape), well_e)
            + read_e * random.standard_normal(shape)
            for sign in (1, -1)
        ]
        # Rounding to words is noise, too.
        rounding_e = 1 / math.sqrt(12) / SENSOR.gain_lsb_per_e
        expected.append(math.hypot(float((taps[0] - taps[1]).std()), rounding_e))
    panel.plot(shares, expected, color=GRAY, lw=2, label="two Poisson taps, cut off and read")
    panel.plot(shares, found, "o", color=BLUE, ms=4, label="samples")
    panel.set_ylim(0)
    label(panel, "charge of tap A over the full well", "standard deviation of D0, electrons")
    worst = max(abs(a / b - 1) for a, b in zip(found, expected, strict=True))
    return Row(
        "noise about a full tap, largest deviation from two taps", "0", f"{100 * worst:.1f} %"
    )


def offsets() -> Made:
    """The offset pattern, what its map leaves, and what both cost in distance."""
    figure, panels = axes(
        "Offset pattern", "Left by the map", "Error without noise", widths=(1, 1, 1.4)
    )
    pattern = draw_offsets(SENSOR, 120, 160, generator=stream(Purpose.OFFSETS, 3))
    left = pattern.pattern_lsb - pattern.calibrated_lsb
    for panel, values in zip(panels, (pattern.pattern_lsb, left), strict=False):
        corner = values[0, 30:70, 30:70]
        image = show(figure, panel, corner, cmap="RdBu_r", vmin=-50, vmax=50)
    panels[1].set(ylabel="", yticklabels=[])
    figure.colorbar(image, ax=panels[:2], label="LSB", shrink=0.6)
    amplitudes = np.geomspace(60, 1200, 8)
    for name, shots, known, colour in (
        ("2 DCS", Shots.TWO, None, RED),
        ("2 DCS with map", Shots.TWO, pattern.calibrated_lsb, GREEN),
        ("4 DCS", Shots.FOUR, None, BLUE),
    ):
        found = [_offset_rms_m(shots, pattern, known, amplitude) for amplitude in amplitudes]
        panels[2].plot(amplitudes, 1e3 * np.array(found), "o", ms=4, color=colour, label=name)
    for values in (pattern.pattern_lsb, left):
        rms_lsb = float(values.square().mean().sqrt())
        panels[2].plot(amplitudes, 1e3 * PER_RADIAN_M * rms_lsb / amplitudes, color=GRAY, lw=1)
    panels[2].set(xscale="log", yscale="log", ylim=(0.01, 600))
    label(panels[2], "amplitude, LSB", "rms error, mm", loc="lower left")
    rms_lsb = float(pattern.pattern_lsb.square().mean().sqrt())
    measured = _offset_rms_m(Shots.TWO, pattern, None, 200.0)
    return figure, [
        Row(
            "rms error of 2 DCS by the offset alone, amplitude 200 LSB",
            f"{1e3 * PER_RADIAN_M * rms_lsb / 200:.1f} mm (first order)",
            f"{1e3 * measured:.1f} mm",
        ),
        Row(
            "share of the pattern that the map leaves",
            f"{1 - SENSOR.offset_calibrated_share:.3f}",
            f"{float(left.std() / pattern.pattern_lsb.std()):.3f}",
        ),
    ]


def _offset_rms_m(shots: Shots, pattern, known, amplitude_lsb: float) -> float:
    """Root of the mean square error over a period of distances, no noise."""
    quiet = merged(SINE, {"offset_ambient_lsb": 0.0})
    active = active_of(amplitude_lsb / (quiet.gain_lsb_per_e * quiet.contrast))
    range_m = unambiguous_range_m(quiet.f1_hz)
    true_m = torch.linspace(0, range_m, 160 * 120).reshape(160, 120).T
    still = light_of(quiet, true_m, torch.full((120, 160), active))
    raw = acquired(still, quiet, shots, offsets=pattern)
    measured_m = distance_m(decode(raw.dcs_lsb, offset_lsb=known).phase_rad, quiet.f1_hz)
    return float(apart_m(measured_m, true_m, range_m).square().mean().sqrt())


def temperature() -> Made:
    """Distance and offset over the imager's temperature."""
    figure, panels = axes("Distance drift", "Offset that no map knows")
    imager_k = torch.linspace(283.15, 343.15, 13, dtype=torch.float64)
    celsius = imager_k.numpy() - 273.15
    for name, left_m, colour in (
        ("not compensated", distance_drift_m(SENSOR, imager_k), RED),
        ("compensated", residual_drift_m(SENSOR, imager_k), BLUE),
    ):
        panels[0].plot(celsius, 1e3 * _measured_shift_m(left_m), "o", color=colour, label=name)
        panels[0].plot(celsius, 1e3 * left_m, color=colour, lw=1)
    label(panels[0], "imager, °C", "measured minus true, mm")
    cold, stds = _drawn_at(SENSOR.calibration_temperature_k), []
    for kelvin in imager_k.tolist():
        stds.append(float((_drawn_at(kelvin) - cold).std()))
    expected = SENSOR.offset_drift_lsb_per_k * np.abs(
        imager_k.numpy() - SENSOR.calibration_temperature_k
    )
    panels[1].plot(celsius, expected, color=GRAY, lw=1, label="formula")
    panels[1].plot(celsius, stds, "o", color=BLUE, label="drawn")
    label(panels[1], "imager, °C", "standard deviation, LSB")
    warmer_k = float(imager_k[-1]) - SENSOR.calibration_temperature_k
    expected_m = SENSOR.distance_drift_m_per_k * warmer_k * (1 - SENSOR.drift_compensated_share)
    warm_m = residual_drift_m(SENSOR, imager_k[-1:])
    return figure, [
        Row(
            "drift left at 70 °C by the compensation",
            f"{1e3 * expected_m:.1f} mm",
            f"{1e3 * float(_measured_shift_m(warm_m)[0]):.1f} mm",
        ),
        Row(
            "standard deviation of the offset's change at 70 °C",
            f"{expected[-1]:.3f} LSB",
            f"{stds[-1]:.3f} LSB",
        ),
    ]


def _measured_shift_m(shift_m: torch.Tensor) -> np.ndarray:
    """By how much decoded distances move, one frame for each shift."""
    fine = merged(SINE, {"gain_lsb_per_e": 0.1, "adc_bits": 16, "full_well_e": 1e7})
    still = light_of(fine, torch.full((1, 1), 3.0), torch.full((1, 1), active_of(5e4)))
    frame = decode(acquired(still, fine).dcs_lsb.repeat(len(shift_m), 1, 1, 1))
    moved_m = distance_m(shifted(frame, shift_m, fine.f1_hz).phase_rad, fine.f1_hz)
    return (moved_m - distance_m(frame.phase_rad, fine.f1_hz)).flatten().double().numpy()


def _drawn_at(kelvin: float) -> torch.Tensor:
    generator = stream(Purpose.OFFSETS, 7)
    return draw_offsets(SENSOR, 120, 160, generator=generator, imager_k=kelvin).pattern_lsb


def gray() -> Made:
    """Exposure, signal to noise and motion blur of the gray image."""
    figure, panels = axes("Exposure", "Signal to noise", "A passing square")
    levels = np.geomspace(1e-4, 10, 12)
    rate = electrons_per_radiance_second(SENSOR)
    exposures, ratios, expected = [], [], []
    for level in levels:
        flat = torch.full((1, 120, 160), level, dtype=torch.float32)
        noise = torch.randn(flat.shape, generator=torch.Generator().manual_seed(1))
        words, exposure_s = capture_gray(flat, SENSOR, noise=noise)
        exposures.append(float(exposure_s))
        ratios.append(float(words.double().mean() / words.double().std()))
        charge_e = rate * level * exposures[-1]
        # A rounded word errs evenly within one step, whose variance is 1 / 12.
        rounding_e2 = 1 / 12 / gray_gain_lsb_per_e(SENSOR) ** 2
        expected.append(charge_e / math.sqrt(charge_e + SENSOR.read_noise_e**2 + rounding_e2))
    wanted = SENSOR.gray_target * SENSOR.full_well_e / (rate * levels)
    limited = np.minimum(wanted, SENSOR.gray_max_exposure_s)
    panels[0].plot(levels, 1e3 * limited, color=GRAY, lw=1, label="formula")
    panels[0].plot(levels, 1e3 * np.array(exposures), "o", ms=4, color=BLUE, label="captured")
    panels[1].plot(levels, expected, color=GRAY, lw=1, label="formula")
    panels[1].plot(levels, ratios, "o", ms=4, color=BLUE, label="captured")
    for panel, y in zip(panels, ("exposure, ms", "mean over standard deviation"), strict=False):
        panel.set(xscale="log", yscale="log", xticks=[1e-4, 1e-2, 1])
        label(panel, "radiance, W/(m² sr)", y)
    _blur(panels[2])
    return figure, [
        Row(
            f"gray signal to noise at {levels[6]:.2g} W/(m² sr)",
            f"{expected[6]:.1f}",
            f"{ratios[6]:.1f}",
        )
    ]


def _blur(panel) -> None:
    """Middle row of a bright square at 60 m/s, 5 m away, by exposure."""
    camera = CAMERA.model_copy(
        update={"width": 64, "height": 32, "gray_instants": 16, "samples_per_pixel": 16}
    )
    face = plate((0, 0, 0), (0.5, 0, 0), (0, 0, 0.5), emission=1.0)
    passing = moving(face, (5.0, 0.0, 1.0), math.pi / 2, 60.0)
    buried = plate((0, 0, -50), (1, 0, 0), (0, 1, 0))
    for exposure_s, colour in ((1e-4, BLUE), (5e-3, RED)):
        frame = rendered(world(buried, passing), camera, gray_exposure_s=exposure_s)
        name = f"{1e3 * exposure_s:g} ms"
        panel.plot(frame.ambient[16], color=colour, label=name)
    panel.set(xlim=(18, 48), ylim=(-0.05, 1.4))
    label(panel, "column", "radiance, W/(m² sr)", loc="upper center", ncols=2)
