"""Figure of the light that paths of few surfaces leave out, and of what deeper paths cost."""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np

from figures.renderer import SEEDS, closed_room, sensor_noise_m, smooth
from figures.stage import (
    BLUE,
    CAMERA,
    GRAY,
    GREEN,
    PER_RADIAN_M,
    RED,
    SENSOR,
    Made,
    Row,
    axes,
    label,
    world,
)
from shotenv.config import CameraConfig, WorldConfig
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES
from shotenv.render import FrameRenderer, Instants, RenderedFrame
from shotenv.world import draw_world
from shotenv.world.geometry import World

DEPTHS = (1, 2, 3, 4)
"""Surfaces of a light path that are judged."""
REFERENCE = 8
"""Surfaces of the paths that they are held against: the most there may be."""
COLOURS = dict(zip(DEPTHS, (GRAY, BLUE, GREEN, RED), strict=True))


class LeftOut(NamedTuple):
    """What paths of one depth leave out of the light of the deepest, in one world or some.

    Attributes
    ----------
    error_m : float
        Error in distance, rms over smooth pixels where one sample's SNR is above 5, metres.
    active : float
        Share of the laser's phasor in those pixels, rms: |difference| over |phasor|.
    ambient : float
        Share of the ambient light of all surfaces in view.
    """

    error_m: float
    active: float
    ambient: float


def path_depth() -> Made:
    """Light left out by paths of 1 to 4 surfaces, by family and in a closed room; their cost."""
    figure, panels = axes("Distance, rms", "Ambient light", "Closed room", widths=(1.1, 1.1, 1))
    names = (*FAMILIES, *SHIFT_FAMILIES)
    rows, left = [], {}
    for name in names:
        left[name], sensor_m = _left_out(name)
        family, per_depth = name.replace("_", " "), left[name]
        which = f"left out by {_list(DEPTHS, 'd')} of {REFERENCE} surfaces, {family}"
        rows += [
            Row(
                f"{which}: rms in distance; share of the laser's phasor",
                f"sensor, 4 DCS: {1e3 * sensor_m:.0f} mm",
                f"{_list((1e3 * one.error_m for one in per_depth), '.1f')} mm; "
                f"{_list((100 * one.active for one in per_depth), '.1f')} %",
            ),
            Row(
                f"{which}: share of the ambient light",
                "(none)",
                f"{_list((100 * one.ambient for one in per_depth), '.1f')} %",
            ),
        ]
    place = np.arange(len(names))
    for panel, field, unit, least, title in (
        (panels[0], "error_m", 1e3, 0.05, "mm"),
        (panels[1], "ambient", 100, 0.01, "% left out"),
    ):
        for index, depth in enumerate(DEPTHS):
            values = [max(least, unit * getattr(left[name][index], field)) for name in names]
            surfaces = f"{depth} surface{'s' * (depth > 1)}" if panel is panels[0] else None
            panel.plot(
                values, place, "o", color=COLOURS[depth], ms=4, label=surfaces, clip_on=False
            )
        panel.set(xscale="log", xlabel=title, ylim=(len(names) - 0.5, -0.5))
        panel.set_xlim(left=least)
    panels[0].set_yticks(place, [name.replace("_", " ") for name in names])
    panels[1].set_yticks(place, [""] * len(names))
    figure.legend(loc="outside lower center", ncols=len(DEPTHS))
    return figure, [*rows, *_of_closed_room(panels[2]), _cost(names)]


def _list(numbers, form: str) -> str:
    """Numbers in their order, such as `1, 2, 3`."""
    return ", ".join(format(number, form) for number in numbers)


def _left_out(family: str) -> tuple[list[LeftOut], float]:
    """What each of `DEPTHS` leaves out in the worlds of a family, and the sensor's noise (m)."""
    camera = CameraConfig(width=64, height=48, samples_per_pixel=64, gray_filter_m=0.0)
    found, noise = [], []
    for seed in SEEDS:
        scene = draw_world(family, seed, WorldConfig())
        # Two independent halves of the random numbers, which all depths of a half share.
        halves = [
            {depth: _light(scene, camera, depth, half) for depth in (*DEPTHS, REFERENCE)}
            for half in (1, 2)
        ]
        _, deepest = halves[0][REFERENCE]
        sigma_m, snr = sensor_noise_m(deepest)
        counted = smooth(deepest.distance_m) & (snr > 5)
        found.append([_squares(halves, depth, counted) for depth in DEPTHS])
        noise.append((sigma_m[counted] ** 2).mean())
    means = np.mean(found, axis=0)
    roots = np.sqrt(np.maximum(means[:, :2], 0.0))
    left = [LeftOut(*root, share) for root, share in zip(roots, means[:, 2], strict=True)]
    return left, np.sqrt(np.mean(noise))


def _light(
    scene: World, camera: CameraConfig, depth: int, seed: int
) -> tuple[np.ndarray, RenderedFrame]:
    """Phasor [H, W] of the laser's light at f1 by paths of `depth` surfaces, and the frame."""
    from shotenv.render.backend import start_mitsuba

    start_mitsuba()
    from shotenv.render.integrator import trace

    both = Instants(
        (0.5,) * 2, (True,) * 2, (True, False), (0,) * 2, (SENSOR.f1_hz,) * 2, (0.0, np.pi / 2)
    )
    traced = trace(scene, both, camera.model_copy(update={"bounces": depth}), seed=seed)
    phasor = traced.correlation[0] + 1j * traced.correlation[1]
    frame = (traced.correlation, traced.active[0], traced.ambient[0], traced.distance_m[0])
    return phasor, RenderedFrame(*frame)


def _squares(halves, depth: int, counted: np.ndarray) -> tuple[float, float, float]:
    """Mean squares of the error in distance (m) and of the phasor's share; the ambient share."""
    errors, shares, ambient = [], [], []
    for half in halves:
        (some, few), (every, deepest) = half[depth], half[REFERENCE]
        ratio = (some / np.where(every == 0, 1, every))[counted]
        errors.append(PER_RADIAN_M * np.angle(ratio))
        shares.append(1 - ratio)
        seen = np.isfinite(deepest.distance_m)
        ambient.append(1 - few.ambient[seen].sum() / deepest.ambient[seen].sum())
    # The noise of the halves is independent: it is not in the mean of their product.
    square = (shares[0] * shares[1].conj()).real.mean()
    return (errors[0] * errors[1]).mean(), square, np.mean(ambient)


def _of_closed_room(panel) -> list[Row]:
    """Multi-path of a closed room, by the surfaces of the longest path: mean over its pixels."""
    camera = CAMERA.model_copy(update={"width": 32, "height": 24, "samples_per_pixel": 64})
    scene, depths = world(closed_room()), range(1, REFERENCE + 1)
    phasors = np.array([_light(scene, camera, depth, 1)[0] for depth in depths])
    late = np.angle(phasors / phasors[0]).mean(axis=(1, 2))
    panel.plot(depths, 1e3 * late, "o-", color=BLUE)
    panel.set(ylim=(0, None), xticks=list(depths))
    label(panel, "surfaces of a path", "multi-path, mrad")
    missing = np.abs(1 - phasors / phasors[-1])
    shares = np.sqrt((missing**2).mean(axis=(1, 2)))
    judged = (*DEPTHS, REFERENCE)
    return [
        Row(
            f"multi-path of a closed room of albedo 0.6 by paths of {_list(judged, 'd')} surfaces: "
            "mean; share of the phasor left out, rms",
            "(none)",
            f"{_list((1e3 * late[depth - 1] for depth in judged), '.0f')} mrad; "
            f"{_list((100 * shares[depth - 1] for depth in judged), '.0f')} %",
        )
    ]


def _cost(names: tuple[str, ...]) -> Row:
    """Time of a frame over that of paths of 2 surfaces, one world of each family."""
    camera, ratios = CameraConfig(), []
    for name in names:
        renderer = FrameRenderer(draw_world(name, SEEDS[0], WorldConfig()), SENSOR)
        seconds = np.zeros((4, len(DEPTHS)))
        # Depths in turn, so that what else the machine does weighs on all of them; the first
        # round also compiles.
        for turn in seconds:
            for index, depth in enumerate(DEPTHS):
                deep = camera.model_copy(update={"bounces": depth})
                start = time.process_time()
                renderer.frame(0.5, deep, seed=index)
                turn[index] = time.process_time() - start
        least = seconds[1:].min(axis=0)
        ratios.append(least / least[DEPTHS.index(2)])
    spans = zip(*np.quantile(ratios, (0.0, 0.5, 1.0), axis=0), strict=True)
    return Row(
        f"processor time of a frame by paths of {_list(DEPTHS, 'd')} surfaces over that of 2: "
        "median family (least to most)",
        "(none)",
        ", ".join(f"{median:.2f} ({low:.2f} to {high:.2f})" for low, median, high in spans),
    )
