"""Daylight deep in a hall, by rays aimed at its openings: a closed form's mean, and less noise."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from render_worlds import at, mesh, square, world

from shotenv.world.geometry import Indoor, Light, World

pytestmark = pytest.mark.render
LENGTH_M, HALF_WIDTH_M, HEIGHT_M = 20.0, 3.0, 3.0
POINT_M = (12.0, 1.0)
"""A point of the floor (x, y): the far opening is 8 m away, the near one 12 m."""
SKY, SUN, SUN_ELEVATION_RAD = 2.0, 5.0, 0.2
RAYS = 1 << 15


def hall(*, entrance: bool, sun: float = 0.0) -> World:
    """A hall of dark walls under an even sky, open at x = `LENGTH_M` and perhaps at x = 0."""
    middle, up = (LENGTH_M / 2, 0, HEIGHT_M / 2), (0, 0, HEIGHT_M / 2)
    along, across = (LENGTH_M / 2, 0, 0), (0, HALF_WIDTH_M, 0)
    sides = [np.add(middle, (0, side * HALF_WIDTH_M, 0)) for side in (-1, 1)]
    faces = [square(side, along, up) for side in sides]
    faces += [square((LENGTH_M / 2, 0, z), along, across) for z in (0.0, HEIGHT_M)]
    if not entrance:
        faces.append(square((0, 0, HEIGHT_M / 2), across, up))
    # Reaching a little beyond its walls, as those of drawn worlds do.
    low, high = (0.0, -HALF_WIDTH_M - 0.1, -1.0), (LENGTH_M, HALF_WIDTH_M + 0.1, HEIGHT_M + 0.1)
    mouth = (-HALF_WIDTH_M, 0.0), (HALF_WIDTH_M, HEIGHT_M)
    to_sun = (math.cos(SUN_ELEVATION_RAD), 0.0, math.sin(SUN_ELEVATION_RAD))
    indoor = Indoor(low, high, mouth, mouth if entrance else None)
    return world(mesh(np.concatenate(faces)), light=Light(sun, to_sun, SKY, SKY, (), indoor))


def by_chance(scene: World) -> World:
    """The same, but the renderer does not know where daylight enters."""
    return replace(scene, light=replace(scene.light, indoor=None))


def sky_through(distance_m: float) -> float:
    """Irradiance of the floor by the sky in an opening: that of an upright rectangle on the floor.

    Of a corner at (0, 0), width b, height a and distance c, the view factor is
    (atan(b / c) - c / h atan(b / h)) / (2 pi), h = hypot(a, c).
    """
    slant_m = math.hypot(HEIGHT_M, distance_m)
    factor = 0.0
    for width_m in (HALF_WIDTH_M - POINT_M[1], HALF_WIDTH_M + POINT_M[1]):
        near = math.atan(width_m / distance_m)
        far = distance_m / slant_m * math.atan(width_m / slant_m)
        factor += (near - far) / (2 * math.pi)
    return math.pi * SKY * factor


@pytest.fixture(scope="module")
def estimates():
    """Estimates [RAYS] of the irradiance at `POINT_M` by one ray each: of the sky, of daylight."""
    from shotenv.render.backend import start_mitsuba

    start_mitsuba()
    import mitsuba as mi

    from shotenv.render.light import PassiveLight
    from shotenv.render.surfaces import Scene, Surroundings, posed

    def drawn(scene: World) -> tuple[np.ndarray, np.ndarray]:
        instants, surroundings = at(0.0), Surroundings(scene)
        traced = Scene(surroundings, posed(scene, surroundings.faces, instants.times_s, bounces=1))
        random = np.random.default_rng(5)
        aim, number = mi.Point2f(random.random((2, RAYS))), mi.Float(random.random(RAYS))
        instant, active = mi.UInt32(np.zeros(RAYS)), mi.Bool(np.ones(RAYS, bool))
        start = mi.Point3f(np.tile([[*POINT_M, 1.0]], (RAYS, 1)).T)
        hit = traced.hit(start, mi.Vector3f(0, 0, -1), instant, active)
        passive = PassiveLight(scene, instants)
        sky = passive.sky_irradiance(traced, hit, instant, [aim], active)
        daylight = passive.daylight(traced, hit, instant, aim, number, active)
        return sky.numpy().astype(float), daylight.numpy().astype(float)

    return drawn


def assert_mean(values: np.ndarray, expected: float, within: float) -> None:
    """The mean is as expected by its standard error, and that is a small share of it."""
    error = values.std() / math.sqrt(len(values))
    assert abs(values.mean() - expected) < 4 * error
    assert error < within * expected


@pytest.mark.parametrize("entrance", [False, True])
def test_rays_aimed_at_the_openings_bring_the_skys_light_with_less_noise(estimates, entrance):
    scene = hall(entrance=entrance)
    expected = sky_through(LENGTH_M - POINT_M[0]) + entrance * sky_through(POINT_M[0])
    aimed, daylight = estimates(scene)
    scattered, _ = estimates(by_chance(scene))
    assert_mean(aimed, expected, within=0.01)
    assert_mean(daylight, expected, within=0.01)
    assert_mean(scattered, expected, within=0.05)
    assert aimed.var() < 0.05 * scattered.var()


def test_daylight_deep_indoors_is_that_of_sky_and_sun(estimates):
    expected = sky_through(LENGTH_M - POINT_M[0]) + SUN * math.sin(SUN_ELEVATION_RAD)
    _, daylight = estimates(hall(entrance=False, sun=SUN))
    assert_mean(daylight, expected, within=0.01)
