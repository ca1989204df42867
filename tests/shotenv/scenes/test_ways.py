"""Ways: poses over time, and way points that are driven at a speed."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from pydantic import ValidationError

from shotenv.config.own_scene import OwnClip
from shotenv.scenes.ways import monotone_slopes, motion_of
from shotenv.world.geometry.motion import ground_speed_m_s, yaw_rate_rad_s


def posed(*rows, **fields) -> OwnClip:
    names = ("time_s", "position_m", "yaw_deg", "pitch_deg", "roll_deg")
    return OwnClip(poses=[dict(zip(names, row, strict=False)) for row in rows], **fields)


def test_poses_are_passed_at_their_times_from_the_first_on():
    way = motion_of(
        posed((2.0, (0, 0, 1), 0, 0, 0), (3.0, (1, 2, 1), 20, 5, 1), (5.0, (4, 2, 2), 40, 0, 0))
    )
    pose = way.at(1.0)
    assert pose.position_m == pytest.approx((1, 2, 1))
    assert np.degrees([pose.yaw_rad, pose.pitch_rad, pose.roll_rad]) == pytest.approx([20, 5, 1])
    assert way.at(3.0).position_m == pytest.approx((4, 2, 2))


def test_two_poses_are_a_straight_way_that_goes_on_before_and_after():
    way = motion_of(posed((0, (0, 0, 1)), (2, (3, 0, 1))))
    for time in (-0.1, 0.7, 2.3):
        assert way.at(time).position_m == pytest.approx((1.5 * time, 0, 1))


def test_angles_turn_the_shorter_way_round():
    way = motion_of(posed((0, (0, 0, 1), 170), (1, (0, 0, 1), -170)))
    assert math.degrees(way.at(0.5).yaw_rad) == pytest.approx(180)
    assert yaw_rate_rad_s(way, 0.5) == pytest.approx(math.radians(20), rel=1e-3)


def test_velocity_has_no_jumps_and_who_stands_stands():
    way = motion_of(
        posed((0, (0, 0, 1)), (1, (2, 0, 1)), (2, (2, 0, 1)), (3, (2, 0, 1)), (4, (5, 1, 1)))
    )
    at = np.array([way.at(t).position_m for t in np.linspace(0.0, 4.0, 4001)])
    assert np.abs(np.diff(at, 2, axis=0)).max() < 2e-5  # 20 m/s^2 at 1 ms
    assert (at[1000:3001] == at[1000]).all()


def test_a_cubic_between_rising_values_rises():
    at, values = np.array([0.0, 1.0, 1.5, 4.0]), np.array([[0.0], [5.0], [5.1], [5.2]])
    assert (monotone_slopes(at, values) >= 0).all()
    way = motion_of(posed(*((t, (x, 0, 1)) for t, (x,) in zip(at, values, strict=True))))
    x = [way.at(t).position_m[0] for t in np.linspace(0, 4, 400)]
    assert (np.diff(x) >= -1e-12).all()


def drive(speed, *points) -> OwnClip:
    return OwnClip(waypoints_m=points or ((0, 0, 1), (5, 0, 1), (8, 4, 1)), speed_m_s=speed)


def test_a_drive_has_the_speed_that_was_told_and_heads_along_its_way():
    way = motion_of(drive(((1, 2.0), (3, 4.0), (4, 0.0))))
    for time, speed in ((0.5, 2.5), (1.5, 3.5), (2.5, 2.0)):
        assert ground_speed_m_s(way, time) == pytest.approx(speed, rel=5e-3)
        pose, soon = way.at(time), way.at(time + 0.01)
        heading = np.subtract(soon.position_m, pose.position_m)
        assert math.atan2(heading[1], heading[0]) == pytest.approx(pose.yaw_rad, abs=0.02)
    assert way.at(3.0).position_m == pytest.approx(way.at(2.9999).position_m, abs=1e-3)


def test_negative_speed_reverses_without_turning():
    way = motion_of(drive(((0, 2.0), (2, -2.0)), (0, 0, 1), (5, 0, 1)))
    assert way.at(1.0).position_m == pytest.approx((1, 0, 1), abs=1e-6)
    assert ground_speed_m_s(way, 1.5) == pytest.approx(-1.0, rel=1e-3)
    assert way.at(1.9).yaw_rad == 0.0


def test_a_slope_tips_the_car():
    way = motion_of(drive(((0, 1.0), (1, 1.0)), (0, 0, 0), (2, 0, 2)))
    assert way.at(0.5).pitch_rad == pytest.approx(-math.pi / 4)
    # Positive pitch looks down; beyond the ends it goes on as before.
    assert way.at(-0.1).position_m == pytest.approx(-0.1 * np.array([1, 0, 1]) / math.sqrt(2))


def test_a_speed_that_leaves_the_way_is_refused():
    with pytest.raises(ValueError, match=r"drives from 0.000 to 6.000 m .* 0 to 5.000 m"):
        motion_of(drive(((0, 2.0), (3, 2.0)), (0, 0, 1), (5, 0, 1)))
    with pytest.raises(ValueError, match=r"from -1.000 to 0.000 m"):
        motion_of(drive(((0, -1.0), (1, -1.0)), (0, 0, 1), (5, 0, 1)))


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({}, "has poses and way points, or neither"),
        ({"poses": [{"time_s": 0, "position_m": (0, 0, 0)}]}, "poses has 1 entries"),
        ({"waypoints_m": [(0, 0, 0), (1, 0, 0)]}, "speed_m_s has 0 entries"),
        ({"waypoints_m": [(0, 0, 0)], "speed_m_s": [(0, 1), (1, 1)]}, "waypoints_m has 1"),
        (
            {"waypoints_m": [(0, 0, 0), (1, 0, 0)], "speed_m_s": [(0, 1), (0, 2)]},
            "speed_m_s has time 0 s after 0 s; expected times that rise",
        ),
        (
            {"poses": [{"time_s": t, "position_m": (0, 0, 0)} for t in (0, 2, 1)]},
            "poses has time 1 s after 2 s; expected times that rise",
        ),
        (
            {"waypoints_m": [(1, 0, 0), (1, 0, 0)], "speed_m_s": [(0, 0), (1, 0)]},
            "twice in a row",
        ),
        (
            {"poses": [{"time_s": t, "position_m": (math.nan, 0, 0)} for t in (0, 1)]},
            "finite number",
        ),
    ],
)
def test_a_clip_that_tells_no_way_is_refused(fields, said):
    with pytest.raises(ValidationError, match=re.escape(said)):
        OwnClip(**fields)


def test_a_clip_is_as_many_frames_as_it_is_long():
    clip = posed((0.5, (0, 0, 0)), (1.2, (0, 0, 0)))
    assert [clip.frames(rate) for rate in (10.0, 20.0, 1.0)] == [7, 14, 0]
