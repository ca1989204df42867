"""The integrator against closed forms, a slow quadrature, and Mitsuba's own path integrator."""

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
from shotenv.world.geometry.model import Lamp, Light, Mesh, MovingObject
from shotenv.world.geometry.motion import Arc, Pose

pytestmark = pytest.mark.render
SPEED_OF_LIGHT_M_S = 299_792_458.0
F1_HZ, F2_HZ = 24e6, 10e6


@pytest.fixture(scope="module")
def trace():
    start_mitsuba()
    from shotenv.render.integrator import trace

    return trace


@pytest.mark.parametrize("distance_m", [0.7, 7.3, 60.0])
def test_a_wall_is_at_its_distance(trace, distance_m):
    traced = trace(world(mesh(wall(distance_m))), at(0.0), SMALL, seed=0)
    expected = distance_m / ray_directions(SMALL)[..., 0]
    assert np.abs(traced.distance_m[0] - expected).max() < 1e-4


def test_a_tilted_plane_is_at_its_distance_and_returns_its_light(trace):
    normal, point = np.array([-0.8, 0.3, 0.4]), np.array([5.0, 0.0, 1.0])
    across = np.cross(normal, [0, 0, 1])
    plane = square(point, 50 * across, 50 * np.cross(across, normal))
    traced = trace(world(mesh(plane)), at(0.0), SMALL, seed=0)
    cosine = -ray_directions(SMALL) @ normal / np.linalg.norm(normal)
    expected = normal @ ([0, 0, 1] - point) / (np.linalg.norm(normal) * cosine)
    assert np.abs(traced.distance_m[0] - expected).max() < 1e-4
    np.testing.assert_allclose(traced.active[0], laser_return(expected, cosine), rtol=1e-4)


def test_a_camera_that_pitches_and_turns_sees_the_floor_where_it_is(trace):
    ego = Arc(Pose((3.0, -2.0, 1.5), yaw_rad=0.7, pitch_rad=0.9))
    traced = trace(replace(world(mesh(floor())), ego=ego), at(0.0), SMALL, seed=0)
    assert traced.distance_m[0][MIDDLE] == pytest.approx(1.5 / math.sin(0.9), abs=1e-4)


def test_nothing_ahead_is_infinitely_far(trace):
    traced = trace(world(mesh(wall(-5.0))), at(0.0), SMALL, seed=0)
    assert np.isinf(traced.distance_m).all()
    assert not traced.active.any()
    assert not traced.correlation.any()


@pytest.mark.parametrize("frequency_hz", [F1_HZ, F2_HZ])
def test_the_phase_is_that_of_the_way_to_the_wall_and_back(trace, frequency_hz):
    scene = world(mesh(wall(7.3)))
    found = phasor(trace, scene, SMALL, frequency_hz)
    distance = 7.3 / ray_directions(SMALL)[..., 0]
    turned = found * np.exp(-4j * np.pi * frequency_hz * distance / SPEED_OF_LIGHT_M_S)
    assert np.abs(np.angle(turned)).max() < 1e-4
    active = trace(scene, at(0.0), SMALL, seed=0).active[0]
    np.testing.assert_allclose(np.abs(found), active, rtol=1e-5)


@pytest.mark.parametrize("distance_m", [1.0, 5.0, 25.0])
def test_the_laser_return_falls_with_the_square_of_the_distance(trace, distance_m):
    traced = trace(world(mesh(wall(distance_m))), at(0.0), SMALL, seed=0)
    cosine = ray_directions(SMALL)[..., 0]
    expected = laser_return(distance_m / cosine, cosine)
    np.testing.assert_allclose(traced.active[0], expected, rtol=1e-4)


def test_a_retro_reflector_returns_more(trace):
    traced = trace(world(mesh(wall(5.0), retro=300.0)), at(0.0), SMALL, seed=0)
    assert traced.active[0][MIDDLE] == pytest.approx(301 * laser_return(5.0, 1.0), rel=1e-4)


def test_the_sun_on_a_plane(trace):
    sun = Light(12.0, (-0.6, 0.0, 0.8), 0.0, 0.0, ())
    traced = trace(world(mesh(wall(5.0)), light=sun), at(0.0), SMALL, seed=0)
    np.testing.assert_allclose(traced.ambient, ALBEDO / math.pi * 12.0 * 0.6, rtol=1e-5)


def test_a_thing_throws_its_shadow(trace):
    sun = Light(12.0, (-0.6, 0.0, 0.8), 0.0, 0.0, ())
    roof = square((3.0, 0, 8.0), (2.5, 0, 0), (0, 50, 0))
    shaded = joined(mesh(wall(5.0)), mesh(roof))
    traced = trace(world(shaded, light=sun), at(0.0), SMALL, seed=0)
    # The sun's rays climb 4/3 per metre: those to z in [4.3, 11] pass the roof, all others not.
    height = 1.0 + 5.0 * ray_directions(SMALL)[..., 2] / ray_directions(SMALL)[..., 0]
    through = (8.0 - height) / (4 / 3)
    in_shade = (through > 0.0) & (through < 4.5)
    assert in_shade.any() and not in_shade.all()
    np.testing.assert_array_equal(traced.ambient[0] == 0, in_shade)


def test_an_even_sky_on_a_plane(trace):
    sky = Light(0.0, (0.0, 0.0, 1.0), 2.5, 2.5, ())
    traced = trace(world(mesh(wall(5.0)), light=sky), at(0.0), SMALL, seed=0)
    np.testing.assert_allclose(traced.ambient, ALBEDO * 2.5, rtol=1e-5)


def test_the_sky_is_linear_in_the_sine_of_elevation(trace):
    zenith, horizon = 3.0, 1.0
    light = Light(0.0, (0.0, 0.0, 1.0), zenith, horizon, ())
    camera = SMALL.model_copy(update={"samples_per_pixel": 256})
    looking_down = world(mesh(floor()), light=light, pitch_rad=math.pi / 2)
    traced = trace(looking_down, at(0.0), camera, seed=0)
    # Irradiance of L(s) = h + (z - h) s, s the sine: 2 pi int s L(s) ds = pi (h + 2/3 (z - h)).
    expected = ALBEDO * (horizon + 2 / 3 * (zenith - horizon))
    assert traced.ambient.mean() == pytest.approx(expected, rel=2e-3)
    looking_up = world(mesh(floor()), light=light, pitch_rad=-math.pi / 2)
    up = trace(looking_up, at(0.0), SMALL, seed=0)
    sine = ray_directions(SMALL)[..., 0]
    np.testing.assert_allclose(up.ambient[0], horizon + (zenith - horizon) * sine, rtol=1e-5)


def test_a_lamp_on_a_wall(trace):
    lamp = Lamp((3.0, 0.5, 1.5), intensity_w_sr=4.0, radius_m=0.2)
    light = replace(DARK, lamps=(lamp,))
    traced = trace(world(mesh(wall(5.0)), light=light), at(0.0), SMALL, seed=0)
    rays = ray_directions(SMALL)
    points = np.array([0.0, 0.0, 1.0]) + rays * (5.0 / rays[..., :1])
    away = np.asarray(lamp.position_m) - points
    square_m2 = (away**2).sum(axis=-1)
    irradiance = 4.0 * 2.0 / np.sqrt(square_m2) / (square_m2 + 0.2**2)
    np.testing.assert_allclose(traced.ambient[0], ALBEDO / math.pi * irradiance, rtol=1e-4)


def test_lamps_add_up(trace):
    lamps = tuple(Lamp((x, y, 1.5), 1.0) for x, y in ((3.0, 0.5), (4.0, -1.0), (2.0, 0.0)))
    room = mesh(wall(5.0))
    together = trace(world(room, light=replace(DARK, lamps=lamps)), at(0.0), SMALL, seed=0)
    apart = [
        trace(world(room, light=replace(DARK, lamps=(lamp,))), at(0.0), SMALL, seed=0)
        for lamp in lamps
    ]
    expected = sum(part.ambient for part in apart)
    np.testing.assert_allclose(together.ambient, expected, rtol=1e-4)


def test_a_spot_lamp_is_dark_beyond_its_cutoff(trace):
    lamp = Lamp((0.0, 0.0, 1.0), 4.0, 0.1, (1.0, 0.0, 0.0), cutoff_cos=math.cos(0.2))
    traced = trace(
        world(mesh(wall(5.0)), light=replace(DARK, lamps=(lamp,))), at(0.0), SMALL, seed=0
    )
    lit = ray_directions(SMALL)[..., 0] > math.cos(0.2)
    np.testing.assert_array_equal(traced.ambient[0] > 0, lit)
    assert traced.ambient[0][MIDDLE] == pytest.approx(ALBEDO / math.pi * 4.0 / 25.01, rel=1e-4)


def test_lamps_ride_with_the_camera_or_stay(trace):
    rides = Lamp((1.0, 0.0, 1.0), 4.0, 0.1, rides=True)
    for lamp, gap_m in ((rides, 5.0), (replace(rides, rides=False), 9.0)):
        driving = world(mesh(wall(10.0)), light=replace(DARK, lamps=(lamp,)), speed_m_s=2.0)
        traced = trace(driving, at(2.0), SMALL, seed=0)
        expected = ALBEDO / math.pi * 4.0 / (gap_m**2 + 0.01)
        assert traced.ambient[0][MIDDLE] == pytest.approx(expected, rel=1e-4)


def test_a_lamp_goes_where_its_carrier_goes(trace):
    # In the carrier's own axes the lamp is 1 m ahead and shines ahead: at the wall of x = 10.
    lamp = Lamp((1.0, 0.0, 1.0), 4.0, 0.1, direction=(1.0, 0.0, 0.0), cutoff_cos=0.5, carrier=1)
    buried = mesh(square((0, 0, -50.0), (1, 0, 0), (0, 1, 0)))
    away = MovingObject(buried, Arc(Pose((0.0, 3.0, 0.0)), 50.0))
    coming = MovingObject(buried, Arc(Pose((5.0, -2.0, 0.0), math.pi / 2), 1.0, -math.pi / 4))
    scene = world(mesh(wall(10.0)), light=replace(DARK, lamps=(lamp,)), moving=(away, coming))
    pose = coming.motion.at(2.0)
    assert pose.yaw_rad == pytest.approx(0.0, abs=1e-9)
    gap_m, aside_m = 10.0 - (pose.position_m[0] + 1.0), pose.position_m[1]
    square_m2 = gap_m**2 + aside_m**2
    cosine = gap_m / math.sqrt(square_m2)
    t = (cosine - 0.5) / 0.5
    expected = 4.0 * t * t * (3 - 2 * t) * cosine / (square_m2 + 0.01) * ALBEDO / math.pi
    traced = trace(scene, at(0.0, 2.0), SMALL, seed=0)
    assert traced.ambient[1][MIDDLE] == pytest.approx(expected, rel=1e-4)
    assert traced.ambient[0][MIDDLE] == 0.0


def test_close_to_a_lamp_there_are_no_fireflies(trace):
    camera = SMALL.model_copy(update={"samples_per_pixel": 64, "bounces": 4})
    lamps = (Lamp((4.95, 0.3, 1.0), 1.0), Lamp((2.0, -1.9, 1.0), 1.0))
    sides = [square((2.5, y, 1.0), (4, 0, 0), (0, 0, 4)) for y in (-2.0, 2.0)]
    room = mesh(np.concatenate([wall(5.0), *sides, floor()]), albedo=0.8)
    traced = trace(world(room, light=replace(DARK, lamps=lamps)), at(0.0), camera, seed=0)
    # No light gives more than both lamps at their smallest distance, were all surfaces white.
    brightest = sum(lamp.intensity_w_sr / lamp.radius_m**2 for lamp in lamps) / math.pi
    assert traced.ambient.max() < brightest
    assert traced.ambient.max() / np.median(traced.ambient) < 100


def test_the_camera_sees_a_shining_face_and_nothing_else_does(trace):
    shining = joined(mesh(wall(5.0), emission=3.0), mesh(floor()))
    camera = SMALL.model_copy(update={"bounces": 3})
    traced = trace(world(shining), at(0.0), camera, seed=0)
    on_wall = ray_directions(SMALL)[..., 2] > -1.0 / 5.0 * ray_directions(SMALL)[..., 0]
    np.testing.assert_array_equal(traced.ambient[0], np.where(on_wall, 3.0, 0.0))


def textured(corners: np.ndarray) -> Mesh:
    """A mesh whose albedo follows the noise texture, 1.3 times repeated over each triangle."""
    plain = mesh(corners)
    uv = np.tile(np.float32([[-0.2, 0.1], [1.1, 0.1], [1.1, 1.4]]), (len(corners), 1, 1))
    half = len(corners) // 2
    low, high = np.repeat([0.1, 0.5], half), np.repeat([0.9, 0.5], half)
    return replace(plain, uv=uv, albedo_low=np.float32(low), albedo_high=np.float32(high))


def path_integrator(scene, camera, samples):
    import mitsuba as mi

    from shotenv.render.stock import stock_path, stock_scene

    stock = stock_scene(scene, 0.0, camera)
    return np.array(mi.render(stock, integrator=stock_path(camera), spp=samples, seed=2))[..., 0]


def test_texture_and_perspective_are_those_of_a_stock_scene(trace):
    camera = SMALL.model_copy(update={"samples_per_pixel": 256})
    sun = Light(12.0, (-0.6, 0.0, 0.8), 0.0, 0.0, ())
    scene = world(textured(wall(5.0, half_m=4.0)), light=sun)
    ours = trace(scene, at(0.0), camera, seed=1).ambient[0]
    theirs = path_integrator(scene, camera, 256)
    assert ours.std() > 0.1 * ours.mean()
    assert np.abs(ours - theirs).mean() < 0.01 * ours.mean()


def test_ambient_light_is_that_of_mitsubas_path_integrator(trace):
    camera = SMALL.model_copy(update={"samples_per_pixel": 256, "bounces": 3})
    light = Light(6.0, (-0.48, 0.6, 0.64), 1.0, 1.0, ())
    box = square((3.0, 0.6, 0.5), (0.0, 0.5, 0.0), (0.2, 0.0, 0.5))
    box = MovingObject(textured(box), Arc(Pose((0.0, 0.0, 0.0))))
    scene = world(
        textured(np.concatenate([floor(8.0), wall(5.0, half_m=3.0)])), light=light, moving=(box,)
    )
    ours = trace(scene, at(0.0), camera, seed=1).ambient[0]
    theirs = path_integrator(scene, camera, 512)
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.005)
    assert np.median(np.abs(ours - theirs) / theirs) < 0.03
