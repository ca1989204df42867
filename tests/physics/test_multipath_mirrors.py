"""Mirrors and panes against the folded and dimmed paths that optics gives them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from render_worlds import (
    ALBEDO,
    DARK,
    MIDDLE,
    SMALL,
    at,
    floor,
    joined,
    laser_return,
    mesh,
    phasor,
    ray_directions,
    square,
    wall,
    world,
)

from shotenv.render.backend.llvm import start_mitsuba
from shotenv.world.geometry.model import Lamp, Light, MovingObject
from shotenv.world.geometry.motion import Arc, Pose

pytestmark = pytest.mark.render
SPEED_OF_LIGHT_M_S = 299_792_458.0
F1_HZ = 24e6
TWO = SMALL.model_copy(update={"bounces": 2})
SUN = Light(12.0, (-0.6, 0.0, 0.8), 0.0, 0.0, ())


@pytest.fixture(scope="module")
def trace():
    start_mitsuba()
    from shotenv.render.integrator import trace

    return trace


def turn(path_m):
    """Phasor of a path."""
    return np.exp(2j * np.pi * F1_HZ * path_m / SPEED_OF_LIGHT_M_S)


def pane(x_m, clear, mirror=0.0, albedo=0.0):
    """Glass across the whole view."""
    return mesh(wall(x_m), albedo=albedo, mirror=mirror, clear=clear)


def test_a_mirror_shows_a_wall_at_the_length_of_the_folded_path(trace):
    mirror = square((3.0, 0.0, 1.0), (3.0, 3.0, 0.0), (0.0, 0.0, 9.0))
    aside = square((3.0, 4.0, 1.0), (0.5, 0.0, 0.0), (0.0, 0.0, 0.5))
    scene = world(joined(mesh(mirror, mirror=1.0), mesh(aside)))
    found = phasor(trace, scene, TWO, F1_HZ)
    # The plane x - y = 3 mirrors the eye to (3, -3, 1) and swaps the x and y of directions.
    ray = ray_directions(SMALL)
    distance = 7.0 / ray[..., 0]
    across, up = distance * ray[..., 1], distance * ray[..., 2]
    meets = (np.abs(across) < 0.5) & (np.abs(up) < 0.5)
    expected = np.where(meets, laser_return(distance, ray[..., 0]) * turn(2 * distance), 0)
    # The laser does not reach this wall directly: it stands outside the field of view.
    assert meets.any() and not meets.all()
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


def test_a_wet_floor_shows_a_wall_by_two_ways_of_the_laser(trace):
    share = 0.5
    camera = TWO.model_copy(update={"samples_per_pixel": 256})
    wet = mesh(floor(), albedo=0.0, mirror=share)
    found = phasor(trace, world(joined(mesh(wall(5.0)), wet)), camera, F1_HZ)
    ray = ray_directions(SMALL)
    folded = 5.0 / ray[..., 0]
    mirrored = 1.0 + folded * ray[..., 2] < -0.1  # Whole pixels, away from the foot of the wall.
    point = np.stack([folded * ray[..., 0], folded * ray[..., 1], -1 - folded * ray[..., 2]], -1)
    direct = np.linalg.norm(point - [0.0, 0.0, 1.0], axis=-1)
    assert (np.abs(point[..., 2] - 1.0) < 5.0 * math.tan(math.pi / 6))[mirrored].all()
    back = share**2 * laser_return(folded, ray[..., 0]) * turn(2 * folded)
    aside = share * laser_return(direct, 5.0 / direct) * turn(folded + direct)
    np.testing.assert_allclose(found[mirrored].mean(), (back + aside)[mirrored].mean(), rtol=5e-3)


def test_a_pane_dims_the_laser_twice_and_turns_no_phase(trace):
    camera = TWO.model_copy(update={"samples_per_pixel": 256})
    bare = phasor(trace, world(mesh(wall(5.0))), camera, F1_HZ)
    glazed = world(joined(mesh(wall(5.0)), pane(2.0, clear=0.7)))
    behind = phasor(trace, glazed, camera, F1_HZ)
    np.testing.assert_allclose(behind.mean() / bare.mean(), 0.7**2, rtol=2e-3)
    # One path a pixel: three quarters of them pass, and carry the light of all.
    bare, behind = (phasor(trace, scene, TWO, F1_HZ) for scene in (world(mesh(wall(5.0))), glazed))
    passed = behind != 0
    assert 0.65 < passed.mean() < 0.85
    np.testing.assert_allclose(behind[passed], 0.7**2 / 0.75 * bare[passed], rtol=1e-4)


def test_a_dirty_pane_returns_its_own_light_as_well(trace):
    camera = TWO.model_copy(update={"samples_per_pixel": 256})
    dusty = pane(2.0, clear=0.6, mirror=0.1, albedo=ALBEDO)
    found = phasor(trace, world(joined(mesh(wall(5.0)), dusty)), camera, F1_HZ)[MIDDLE]
    glass, behind = laser_return(2.0, 1.0) * turn(4.0), laser_return(5.0, 1.0) * turn(10.0)
    expected = 0.3 * glass + 0.6**2 * behind
    assert abs(found - expected) < 0.01 * abs(expected)


def test_sunlight_passes_panes_on_its_way(trace):
    roofs = [square((2.0, 0.0, z), (9.0, 0, 0), (0, 50, 0)) for z in (8.0, 9.0)]
    panes = joined(
        *(mesh(roof, clear=clear) for roof, clear in zip(roofs, (0.8, 0.5), strict=True))
    )
    traced = trace(world(joined(mesh(wall(5.0)), panes), light=SUN), at(0.0), SMALL, seed=0)
    np.testing.assert_allclose(traced.ambient, ALBEDO / math.pi * 12.0 * 0.6 * 0.4, rtol=1e-5)


def test_a_pane_and_a_roof_let_nothing_through(trace):
    roofs = [square((2.0, 0.0, z), (9.0, 0, 0), (0, 50, 0)) for z in (8.0, 9.0)]
    shut = joined(mesh(wall(5.0)), mesh(roofs[0], clear=0.8), mesh(roofs[1]))
    assert not trace(world(shut, light=SUN), at(0.0), SMALL, seed=0).ambient.any()


def test_a_moving_pane_dims_a_lamp_where_it_is_then(trace):
    light = replace(DARK, lamps=(Lamp((3.0, 0.0, 8.0), 4.0),))
    glass = mesh(square((0.0, 0.0, 0.0), (9.0, 0, 0), (0, 9.0, 0)), clear=0.6)
    sliding = MovingObject(glass, Arc(Pose((0.0, 0.0, 6.0)), 10.0))
    scene = world(mesh(wall(5.0)), light=light, moving=(sliding,))
    before, after = trace(scene, at(0.0, 5.0), SMALL, seed=0).ambient
    np.testing.assert_allclose(before, 0.6 * after, rtol=1e-5)


def test_the_sky_is_seen_in_a_puddle(trace):
    light = Light(0.0, (0.0, 0.0, 1.0), 3.0, 1.0, ())
    puddle = mesh(floor(), mirror=1.0)
    down = trace(world(puddle, light=light, pitch_rad=1.2), at(0.0), SMALL, seed=0)
    up = trace(world(mesh(floor()), light=light, pitch_rad=-1.2), at(0.0), SMALL, seed=0)
    np.testing.assert_allclose(down.ambient[0], up.ambient[0][::-1], rtol=1e-5)


def test_a_lamp_is_seen_in_a_puddle_and_not_in_dry_ground(trace):
    camera = TWO.model_copy(update={"samples_per_pixel": 64})
    shining = mesh(wall(5.0), albedo=0.0, emission=3.0)
    on_floor = ray_directions(SMALL)[..., 2] < -1.2 / 5.0 * ray_directions(SMALL)[..., 0]
    for share in (0.0, 0.25):
        ground = mesh(floor(), mirror=share)
        ambient = trace(world(joined(shining, ground)), at(0.0), camera, seed=0).ambient[0]
        np.testing.assert_allclose(ambient[on_floor].mean(), 3.0 * share, rtol=0.01)


def test_no_light_is_lost_or_made(trace):
    light = Light(0.0, (0.0, 0.0, 1.0), 2.5, 2.5, ())
    camera = SMALL.model_copy(update={"samples_per_pixel": 16, "bounces": 3})
    glass = pane(5.0, clear=0.3, mirror=0.3, albedo=1.0)
    traced = trace(world(glass, light=light), at(0.0), camera, seed=0)
    np.testing.assert_allclose(traced.ambient, 2.5, rtol=1e-5)
