"""A frame of the sensor against Mitsuba's own path integrator shooting as many rays.

Both render the same world at the same resolution and number of surface hits. The frame includes
posing what moves, building its acceleration structures and copying the results to NumPy;
what stands still in the world, and all of Mitsuba's scene, is built beforehand.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from benchmarks.rows import row
from shotenv.config import CameraConfig, SensorConfig, WorldConfig, find_config, read_config
from shotenv.render import FrameRenderer
from shotenv.render.backend import start_mitsuba
from shotenv.world import draw_world
from shotenv.world.geometry import World
from unwrap.signal import Shots

GOALS = {(160, 120): 1.3, (320, 240): 1.15}
"""Largest ratio by width and height (assumed): in a small frame building scenes weighs more."""
ROUNDS = 9
"""Pairs of which the median ratio counts."""
SEED = 2
"""Any world: both sides render the same."""


def run() -> list[dict[str, Any]]:
    """Time of a frame over that of the path integrator, at each size."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    world = _without_lamps(draw_world("sunny_road", SEED, WorldConfig()))
    return [
        _race(world, CameraConfig(width=w, height=h), sensor, goal)
        for (w, h), goal in GOALS.items()
    ]


def _race(world: World, camera: CameraConfig, sensor: SensorConfig, goal: float) -> dict[str, Any]:
    path, renderer = _path_render(world, camera), FrameRenderer(world, sensor)
    times = alternating(lambda i: renderer.frame(0.0, camera, seed=i), path, ROUNDS)
    # Of the pairs' ratios, not the ratio of medians: what slows the machine slows both of a pair.
    ratio = statistics.median(ours / theirs for ours, theirs in times)
    ours, theirs = (statistics.median(column) for column in zip(*times, strict=True))
    samples = (int(Shots.EIGHT) + camera.gray_instants) * camera.samples_per_pixel
    note = (
        f"{1e3 * ours:.0f} ms for a frame of {camera.width} x {camera.height}, {samples} paths a "
        f"pixel, {camera.bounces} bounces; path integrator {1e3 * theirs:.0f} ms for as many rays"
    )
    name = f"render {camera.width} x {camera.height}"
    return row(name, ratio, "<=", goal, note)


def alternating(
    ours: Callable[[int], Any], theirs: Callable[[int], Any], rounds: int
) -> list[tuple[float, float]]:
    """Seconds of two functions called in turn, after a round that is not counted."""
    # The first round compiles the kernels, which takes longer than all the others.
    times = [(_seconds(ours, index), _seconds(theirs, index)) for index in range(rounds + 1)]
    return times[1:]


def _seconds(function: Callable[[int], Any], index: int) -> float:
    start = time.perf_counter()
    function(index)
    return time.perf_counter() - start


def rays_per_pixel(camera: CameraConfig) -> tuple[int, int]:
    """Rays of a frame, and of one sample of the path integrator, in a world without lamps.

    A laser sample shoots a ray per surface hit and, from the second on, one to the laser; a
    passive sample and the path integrator one per hit, one to the sun, and a last one to the sky.
    """
    hits = camera.bounces
    passive = 2 * hits + 1
    instants = int(Shots.EIGHT) * (2 * hits - 1) + camera.gray_instants * passive
    return instants * camera.samples_per_pixel, passive


def _path_render(world: World, camera: CameraConfig) -> Callable[[int], np.ndarray]:
    mitsuba = start_mitsuba()
    # Mitsuba's variant must be set before.
    from shotenv.render import stock_path, stock_scene

    scene, integrator = stock_scene(world, 0.0, camera), stock_path(camera)
    rays, rays_per_sample = rays_per_pixel(camera)
    samples = round(rays / rays_per_sample)
    # To NumPy, as the frame's maps are: Mitsuba computes only when somebody looks.
    return lambda seed: np.array(
        mitsuba.render(scene, integrator=integrator, spp=samples, seed=seed)
    )


def _without_lamps(world: World) -> World:
    """`world` with the light that the stock scene has too: no lamps, an even sky."""
    light = world.light
    return replace(world, light=replace(light, lamps=(), sky_horizon=light.sky_zenith))


if __name__ == "__main__":
    print(run())
