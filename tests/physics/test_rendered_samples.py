"""The eight samples of a frame: each at its own instant, with the harmonics of square light."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from render_worlds import (
    MIDDLE,
    SMALL,
    floor,
    laser_return,
    mesh,
    ray_directions,
    square,
    wall,
    world,
)

from shotenv.render.frame import render_frame
from shotenv.world.geometry.model import MovingObject
from shotenv.world.geometry.motion import Arc, Pose
from unwrap.signal.decoding import decode
from unwrap.signal.shots import (
    demodulation_phase_rad,
    frequency_index,
    harmonic_weights,
    sample_times_s,
)

pytestmark = pytest.mark.render
SPEED_OF_LIGHT_M_S = 299_792_458.0
BURIED = mesh(square((0, 0, -50.0), (1, 0, 0), (0, 1, 0)))


@pytest.fixture
def sensor(sensor):
    """The sensor with sinusoidal light and no stray light, unless a test says otherwise."""
    off = {"harmonic_strength": 0.0, "veiling_glare": 0.0, "ghost": 0.0}
    return sensor.model_copy(update=off)


def coming(distance_m: float, speed_m_s: float):
    """A wall that comes towards the camera."""
    motion = Arc(Pose((distance_m, 0.0, 0.0), math.pi), speed_m_s)
    return world(BURIED, moving=(MovingObject(mesh(wall(0.0)), motion),))


def phase_of(distance_m, frequency_hz: float):
    return 4 * np.pi * frequency_hz * distance_m / SPEED_OF_LIGHT_M_S


@pytest.mark.parametrize("speed_m_s", [0.0, 20.0])
def test_each_sample_sees_a_moving_wall_where_it_is_then(sensor, speed_m_s):
    oncoming = MovingObject(mesh(wall(0.0)), Arc(Pose((10.0, 0.0, 0.0), math.pi), speed_m_s))
    scene = world(mesh(square((0, 0, -50.0), (1, 0, 0), (0, 1, 0))), moving=(oncoming,))
    frame = render_frame(scene, 0.1, SMALL, sensor, seed=0)
    for k, start_s in enumerate(sample_times_s(8, sensor.sample_period_s)):
        distance = 10.0 - speed_m_s * (0.1 + start_s)
        frequency_hz = (sensor.f1_hz, sensor.f2_hz)[frequency_index(k)]
        phase = 4 * math.pi * frequency_hz * distance / SPEED_OF_LIGHT_M_S
        expected = laser_return(distance, 1.0) * math.cos(phase - demodulation_phase_rad(k))
        assert frame.correlation[k][MIDDLE] == pytest.approx(
            expected, abs=2e-4 * laser_return(distance, 1.0)
        )
    assert frame.distance_m[MIDDLE] == pytest.approx(10.0 - speed_m_s * 0.1, abs=1e-4)


def test_driving_at_a_wall_is_as_the_wall_coming(sensor):
    coming = MovingObject(mesh(wall(0.0)), Arc(Pose((10.0, 0.0, 0.0), math.pi), 15.0))
    buried = mesh(square((0, 0, -50.0), (1, 0, 0), (0, 1, 0)))
    there = render_frame(world(buried, moving=(coming,)), 0.05, SMALL, sensor, seed=0)
    here = render_frame(world(mesh(wall(10.0)), speed_m_s=15.0), 0.05, SMALL, sensor, seed=0)
    scale = here.active.max()
    np.testing.assert_allclose(there.correlation, here.correlation, atol=2e-4 * scale)


def test_opposite_samples_cancel_where_nothing_moves(sensor):
    camera = SMALL.model_copy(update={"samples_per_pixel": 4, "bounces": 2})
    corner = np.concatenate([wall(5.0), floor()])
    correlation = render_frame(world(mesh(corner)), 0.0, camera, sensor, seed=0).correlation
    for first, opposite in ((0, 2), (1, 3), (4, 6), (5, 7)):
        residual = np.abs(correlation[first] + correlation[opposite])
        assert residual.max() < 1e-5 * np.abs(correlation).max()


@pytest.mark.parametrize("distance_m", [8.0, 9.1, 10.3, 11.9])
def test_the_motion_error_of_four_samples_has_its_closed_form(sensor, distance_m):
    speed_m_s = 6.0
    frame = render_frame(coming(distance_m, speed_m_s), 0.0, SMALL, sensor, seed=0)
    found = decode(torch.from_numpy(frame.correlation[:4])).phase_rad[MIDDLE].item()
    # D1 - D3 = (1 + e) sin(a + h) and D0 - D2 = (1 - e) cos(a - h), but for a common factor and
    # terms of second order: a is the phase at the mean time, 2 h its change from one sample to
    # the next, 2 e the relative change of amplitude. Hence the phase is off a by
    # h cos(2 a) + e sin(2 a).
    step_m = -speed_m_s * sensor.sample_period_s
    mean = phase_of(distance_m + 1.5 * step_m, sensor.f1_hz)
    h, e = phase_of(step_m, sensor.f1_hz) / 2, -step_m / distance_m
    error = h * math.cos(2 * mean) + e * math.sin(2 * mean)
    assert math.remainder(found - mean, 2 * math.pi) == pytest.approx(error, abs=3e-4)
    assert abs(h) > 0.01


def test_an_edge_that_passes_mixes_what_it_hides_and_shows(sensor):
    near, far, speed_m_s, start_m = 4.0, 9.0, 60.0, 0.3
    shutter = mesh(square((0, 0, 0), (5.0, 0, 0), (0, 0, 9.0)))
    motion = Arc(Pose((near, start_m - 5.0, 1.0), math.pi / 2), speed_m_s)
    scene = world(mesh(wall(far)), moving=(MovingObject(shutter, motion),))
    correlation = render_frame(scene, 0.0, SMALL, sensor, seed=0).correlation
    ray = ray_directions(SMALL)
    left = ray[..., 1] / ray[..., 0] * near
    hidden = []
    for k, time_s in enumerate(sample_times_s(4, sensor.sample_period_s)):
        hidden.append(left < start_m + speed_m_s * time_s)
        depth = np.where(hidden[-1], near, far)
        phase = phase_of(depth / ray[..., 0], sensor.f1_hz) - demodulation_phase_rad(k)
        expected = laser_return(depth / ray[..., 0], ray[..., 0]) * np.cos(phase)
        np.testing.assert_allclose(correlation[k], expected, atol=1e-4 * laser_return(near, 1.0))
    passed = hidden[0] != hidden[2]
    assert passed.any() and not passed.all()
    cancels = np.abs(correlation[0] + correlation[2]) < 1e-5 * laser_return(near, 1.0)
    np.testing.assert_array_equal(cancels, ~passed)


@pytest.mark.parametrize(("highest", "tolerance"), [(7, 0.07), (31, 0.02)])
def test_square_light_correlates_to_a_triangle(sensor, highest, tolerance):
    changes = {"harmonic_strength": 1.0, "highest_harmonic": highest}
    square_wave = sensor.model_copy(update=changes)
    for distance_m in np.linspace(3.0, 3.0 + 6.2457, 9):
        frame = render_frame(world(mesh(wall(distance_m))), 0.0, SMALL, square_wave, seed=0)
        samples = frame.correlation[:4, *MIDDLE] / laser_return(distance_m, 1.0)
        phase = phase_of(distance_m, sensor.f1_hz) - np.arange(4) * np.pi / 2
        series = sum(w * np.cos(h * phase) for h, w in harmonic_weights(1.0, highest))
        np.testing.assert_allclose(samples, series, atol=2e-4)
        away = np.abs(np.remainder(phase + np.pi, 2 * np.pi) - np.pi)
        triangle = np.pi**2 / 8 * (1 - 2 * away / np.pi)
        np.testing.assert_allclose(samples, triangle, atol=tolerance)


def test_harmonics_from_one_cosine_are_those_of_many():
    from shotenv.render.modulation import odd_series

    angle, weights = np.linspace(-7.0, 7.0, 1001), harmonic_weights(0.8, 31)
    many = sum(weight * np.cos(h * angle) for h, weight in weights)
    np.testing.assert_allclose(odd_series(np.cos(angle), weights), many, atol=1e-12)
    single = np.cos(angle).astype(np.float32)
    np.testing.assert_allclose(odd_series(single, weights), many, atol=1e-5)
    np.testing.assert_array_equal(odd_series(single, harmonic_weights(0.0, 31)), single)
