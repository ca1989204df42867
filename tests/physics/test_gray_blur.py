"""Motion blur of the gray image: a bright square that passes by, against its moments."""

from __future__ import annotations

import math

import numpy as np
import pytest
from render_worlds import SMALL, mesh, ray_directions, square, world

from shotenv.config.reader import merged
from shotenv.render.frame import render_frame
from shotenv.world.geometry.model import MovingObject
from shotenv.world.geometry.motion import Arc, Pose

pytestmark = pytest.mark.render
DISTANCE_M, SPEED_M_S, SIDE_M, TIME_S = 5.0, 60.0, 1.0, 0.1
CAMERA = SMALL.model_copy(
    update={"width": 64, "height": 64, "gray_instants": 4, "samples_per_pixel": 64, "bounces": 1}
)


def passing_square():
    """It drives to the left, its face towards the camera; where it is at `TIME_S`: straight on."""
    start = (DISTANCE_M, -SPEED_M_S * TIME_S, 1.0)
    face = mesh(square((0, 0, 0), (SIDE_M / 2, 0, 0), (0, 0, SIDE_M / 2)), emission=3.0)
    ground = mesh(square((0, 0, -50.0), (1, 0, 0), (0, 1, 0)))
    return world(ground, moving=(MovingObject(face, Arc(Pose(start, math.pi / 2), SPEED_M_S)),))


@pytest.mark.parametrize("exposure_s", [2.5e-4, 2e-3, 4e-3])
def test_blur_is_as_long_as_the_square_moves_during_the_exposure(sensor, exposure_s):
    sensor = merged(sensor, {"veiling_glare": 0.0, "ghost": 0.0})
    frame = render_frame(
        passing_square(), TIME_S, CAMERA, sensor, seed=1, gray_exposure_s=exposure_s
    )
    rays = ray_directions(CAMERA)
    across_m = DISTANCE_M * rays[..., 1] / rays[..., 0]
    weight = frame.ambient / frame.ambient.sum()
    mean_m = float((weight * across_m).sum())
    variance_m2 = float((weight * (across_m - mean_m) ** 2).sum())
    moved_m = SPEED_M_S * exposure_s
    # The middle of the exposure lies half of it before the frame starts.
    assert mean_m == pytest.approx(-moved_m / 2, abs=2e-3)
    instants = CAMERA.gray_instants
    blur_m2 = moved_m**2 / 12 * (1 - 1 / instants**2)
    pixel_m = float(np.ptp(across_m)) / (CAMERA.width - 1)
    assert variance_m2 == pytest.approx((SIDE_M**2 + pixel_m**2) / 12 + blur_m2, rel=0.01)
