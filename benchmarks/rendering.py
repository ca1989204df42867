"""A frame of the sensor against Mitsuba's own path integrator.

Once by time for as many rays, once by efficiency, 1 / (squared error x time), for the same light.
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
from shotenv.config import (
    CameraConfig,
    EmissionConfig,
    Family,
    SensorConfig,
    WorldConfig,
    find_config,
    read_config,
)
from shotenv.render import FrameRenderer, Instants
from shotenv.render.backend import start_mitsuba
from shotenv.world import draw_world
from shotenv.world.geometry import Mesh, World, rotation
from unwrap.signal import Shots

GOALS = {(160, 120): 1.9, (320, 240): 1.8}
"""Largest ratio by width and height, of what was measured (1.7 and 1.6). Besides as many rays, a
frame poses what moves and builds its acceleration structures, sums the light of the points that the
laser shines on, filters the gray light and goes through the lens; in a small one all that weighs
more."""
CONE_DEG = 36.0
"""Half angle of the laser's cone where efficiencies are compared: just wider than the view."""
PATH_SAMPLES = 32
"""Paths of a pixel of the path integrator where efficiencies are compared."""
ROUNDS = 9
"""Pairs of which the median ratio counts."""
DRAWS: dict[str, tuple[int, ...]] = {
    "laser": (0,) * int(Shots.EIGHT),
    "ambient": tuple(range(CameraConfig().gray_instants)),
}
"""Kind of light to the random numbers of a frame's instants. Those with the same numbers are an
image each, those with others are averaged to one."""
EFFICIENCY_WORLDS: dict[str, tuple[Family, float]] = {
    "laser": ("garage", 5.0),
    "ambient": ("overcast_street", 1.2),
}
"""Kind of light to the family of the world in which it is compared, and the least efficiency over
that of the path integrator."""
SEED = 2
"""Any world: both sides render the same."""


def run() -> list[dict[str, Any]]:
    """Time of a frame over that of the path integrator, at each size."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    world = _without_lamps(draw_world("sunny_road", SEED, WorldConfig()))
    return [
        _race(world, CameraConfig(width=w, height=h), sensor, goal)
        for (w, h), goal in GOALS.items()
    ] + [_efficiency(light, *world) for light, world in EFFICIENCY_WORLDS.items()]


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


def _efficiency(light: str, family: Family, goal: float) -> dict[str, Any]:
    """Efficiency for one kind of light in a world of matte surfaces, over the path integrator's."""
    world = _matte(_without_lamps(draw_world(family, SEED, WorldConfig())))
    # A round cone, which Mitsuba's spot has too.
    cone = EmissionConfig(profile="table", angle_deg=(0.0, CONE_DEG), intensity=(1.0, 1.0))
    camera = CameraConfig(emission=cone)
    path, ours = _path_of(light, world, camera), _trace_of(light, world, camera)
    error, path_error = (_relative_squared_error(render) for render in (ours, path))
    times = alternating(ours, path, 5)
    launch_s, path_s = (statistics.median(column) for column in zip(*times, strict=True))
    draws = DRAWS[light]
    ours_s = launch_s * len(set(draws)) / len(draws)
    note = (
        f"{family}: error {100 * error**0.5:.2f} % rms in {1e3 * ours_s:.0f} ms; path integrator "
        f"{100 * path_error**0.5:.2f} % in {1e3 * path_s:.0f} ms"
    )
    ratio = path_error * path_s / (error * ours_s)
    return row(f"efficiency, {light} light", ratio, ">=", goal, note)


def _trace_of(light: str, world: World, camera: CameraConfig) -> Callable[[int], np.ndarray]:
    """Laser or ambient light as a frame takes it, by the sensor's renderer, from a seed."""
    start_mitsuba()
    from shotenv.render.integrator import trace
    from shotenv.render.surfaces import Surroundings

    surroundings, laser, draw = Surroundings(world), light == "laser", DRAWS[light]
    still = (0.0,) * len(draw)
    instants = Instants(still, (laser,) * len(draw), (not laser,) * len(draw), draw, still, still)
    name = "active" if laser else "ambient"
    return lambda seed: getattr(
        trace(world, instants, camera, seed=seed, surroundings=surroundings), name
    ).mean(axis=0)


def _path_of(light: str, world: World, camera: CameraConfig) -> Callable[[int], np.ndarray]:
    """The same by Mitsuba's path integrator, an image in about the same time."""
    mitsuba = start_mitsuba()
    from shotenv.render import stock_path, stock_scene

    if light == "laser":
        dark = replace(world.light, sun_irradiance=0.0, sky_horizon=0.0, sky_zenith=0.0)
        scene = stock_scene(replace(world, light=dark), 0.0, camera, laser=_spot(world, camera))
    else:
        scene = stock_scene(world, 0.0, camera)
    integrator = stock_path(camera)
    return lambda seed: np.array(
        mitsuba.render(scene, integrator=integrator, spp=PATH_SAMPLES, seed=seed)
    )[..., 0]


def _spot(world: World, camera: CameraConfig) -> dict[str, Any]:
    """The laser as an emitter of Mitsuba."""
    mitsuba = start_mitsuba()
    from shotenv.render.beam import emitted_sr

    pose = world.ego.at(0.0)
    eye, (ahead, _, up) = np.asarray(pose.position_m), rotation(pose).T
    turn = mitsuba.ScalarTransform4f().look_at(
        origin=eye.tolist(), target=(eye + ahead).tolist(), up=up.tolist()
    )
    edge = {"cutoff_angle": CONE_DEG, "beam_width": CONE_DEG - 0.01}
    return {"type": "spot", "to_world": turn, "intensity": 1 / emitted_sr(camera), **edge}


def _relative_squared_error(render: Callable[[int], np.ndarray]) -> float:
    """Mean over the lit pixels of the variance between seeds over the squared mean."""
    images = np.array([render(seed) for seed in range(100, 108)], dtype=np.float64)
    mean, variance = images.mean(axis=0), images.var(axis=0, ddof=1)
    lit = mean > 0.1 * mean.mean()
    return float((variance[lit] / mean[lit] ** 2).mean())


def _matte(world: World) -> World:
    """`world` with the surfaces that the stock scene has: no mirrors, panes, retro-reflectors."""
    return replace(
        world,
        static=_matte_mesh(world.static),
        moving=tuple(replace(thing, mesh=_matte_mesh(thing.mesh)) for thing in world.moving),
    )


def _matte_mesh(mesh: Mesh) -> Mesh:
    none = np.zeros(len(mesh.corners), np.float32)
    return replace(mesh, mirror=none, clear=none, retro=none, emission=none)


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

    A laser sample shoots further rays of the view, a ray per surface hit with a shadow ray to one
    of the laser's points on all but the last, and from the second on one to the laser. A passive
    sample and the path integrator shoot one per hit, one to the sun, and a last one to the sky;
    ours has further ones to the sky from the first surface.
    """
    start_mitsuba()
    from shotenv.render.integrator import SKY_RAYS, VIEW_RAYS

    hits = camera.bounces
    path = 2 * hits + 1
    laser = 3 * hits - 2 + VIEW_RAYS - 1
    instants = int(Shots.EIGHT) * laser + camera.gray_instants * (path + SKY_RAYS)
    return instants * camera.samples_per_pixel, path


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
