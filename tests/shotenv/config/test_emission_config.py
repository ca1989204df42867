"""Emission profiles: what a table must be, and that it covers the camera's view."""

from __future__ import annotations

import math

import pytest
from pydantic import ValidationError

from shotenv.config import CameraConfig, EmissionConfig

NAN = math.nan


def table(angle_deg, intensity) -> EmissionConfig:
    return EmissionConfig(profile="table", angle_deg=angle_deg, intensity=intensity)


@pytest.mark.parametrize(
    ("angle_deg", "intensity", "message"),
    [
        ((), (), "angle_deg has 0 and intensity 0 numbers; expected as many of both, at least 2"),
        ((0, 40), (1.0,), "angle_deg has 2 and intensity 1 numbers"),
        ((0, 50, 40), (1, 1, 1), "angle_deg is .* expected angles that rise from 0 to <= 90"),
        ((5, 40), (1, 1), "angle_deg is .* expected angles that rise from 0 to <= 90"),
        ((0, NAN, 60), (1, 1, 1), "angle_deg is .* expected angles that rise from 0 to <= 90"),
        ((0, 120), (1, 1), "angle_deg is .* expected angles that rise from 0 to <= 90"),
        ((0, 60), (1, -0.1), "intensity is .* expected finite numbers, none negative"),
        ((0, 60), (1, NAN), "intensity is .* expected finite numbers, none negative"),
        ((0, 60), (math.inf, 1), "intensity is .* expected finite numbers, none negative"),
        ((0, 60), (0, 0), "intensity is .* one above 0"),
    ],
)
def test_a_table_that_is_none_is_refused(angle_deg, intensity, message):
    with pytest.raises(ValidationError, match=message):
        table(angle_deg, intensity)


def test_a_table_without_its_profile_is_refused():
    with pytest.raises(ValidationError, match="but profile is 'flat'; expected profile 'table'"):
        EmissionConfig(angle_deg=(0, 60), intensity=(1, 1))


def test_a_table_covers_the_corners_of_the_view():
    # 60 x 46.8 degrees: corners are 35.8 degrees from the axis.
    CameraConfig(emission=table((0, 36), (1, 1)))
    with pytest.raises(ValidationError, match=r"emission\.angle_deg ends at 35; expected at least"):
        CameraConfig(emission=table((0, 35), (1, 1)))


def test_soft_edges_end_before_light_leaves_backwards():
    with pytest.raises(ValidationError, match=r"emission\.edge_softness_deg is 60; expected less"):
        CameraConfig(horizontal_fov_deg=130, emission=EmissionConfig(edge_softness_deg=60))
