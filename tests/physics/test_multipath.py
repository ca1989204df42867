"""Light that comes by more than one surface: against slow sums and an independent renderer."""

from __future__ import annotations

import math

import numpy as np
import pytest
from render_worlds import (
    ALBEDO,
    SMALL,
    floor,
    mesh,
    phasor,
    ray_directions,
    solid_angle_sr,
    wall,
    world,
)

from shotenv.render.llvm import start_mitsuba

pytestmark = pytest.mark.render
SPEED_OF_LIGHT_M_S = 299_792_458.0
F1_HZ = 24e6


@pytest.fixture(scope="module")
def trace():
    start_mitsuba()
    from shotenv.render.integrator import trace

    return trace


def second_bounce(camera, height_m, wall_m, frequency_hz, steps=200):
    """Phasor of the light laser -> floor -> wall -> camera, summed over patches of the floor.

    Mean over the camera's pixels on the wall, each through its centre.
    """
    eye = np.array([0.0, 0.0, height_m])
    rays = ray_directions(camera).reshape(-1, 3)
    on_wall = eye + rays * (wall_m / rays[:, :1])
    across = math.tan(math.radians(camera.horizontal_fov_deg / 2))
    x = np.linspace(0, wall_m, steps + 1)[:-1] + wall_m / steps / 2
    y = np.linspace(-across * wall_m, across * wall_m, steps + 1)[:-1] + across * wall_m / steps
    patch = np.stack(np.broadcast_arrays(x[:, None], y[None, :], 0.0), axis=-1).reshape(-1, 3)
    area = (wall_m / steps) * (2 * across * wall_m / steps)
    away = patch - eye
    seen = np.abs(away[:, 1:]).max(axis=1) <= across * away[:, 0]
    patch, away = patch[seen], away[seen]
    to_laser = np.linalg.norm(away, axis=1)
    lit = ALBEDO / math.pi / solid_angle_sr(camera) * (height_m / to_laser) / to_laser**2
    total = []
    for point in on_wall[on_wall[:, 2] > 0]:
        between = np.linalg.norm(patch - point, axis=1)
        cosines = (point[2] / between) * ((wall_m - patch[:, 0]) / between)
        radiance = ALBEDO / math.pi * lit * cosines / between**2 * area
        path = np.linalg.norm(point - eye) + between + to_laser
        phase = 2 * math.pi * frequency_hz * path / SPEED_OF_LIGHT_M_S
        total.append((radiance * np.exp(1j * phase)).sum())
    return np.mean(total)


def test_the_second_bounce_is_that_of_a_slow_sum_over_patches(trace):
    camera = SMALL.model_copy(update={"samples_per_pixel": 256, "bounces": 2})
    height_m, wall_m = 1.0, 4.0
    corner = world(mesh(np.concatenate([wall(wall_m), floor()])), height_m=height_m)
    rays = ray_directions(camera)
    on_wall = height_m + wall_m * rays[..., 2] / rays[..., 0] > 0
    both = phasor(trace, corner, camera, F1_HZ)
    first = phasor(trace, corner, camera.model_copy(update={"bounces": 1}), F1_HZ)
    found = (both - first)[on_wall].mean()
    expected = second_bounce(camera, height_m, wall_m, F1_HZ)
    assert abs(found - expected) < 0.03 * abs(expected)
