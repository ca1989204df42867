"""Where things are at each time: poses, and the ways that they move."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

SPEED_STEP_S = 1e-3
"""Time over which speeds are taken: short beside everything that a car or a person does."""


@dataclass(frozen=True)
class Pose:
    """Position (x, y, z) in metres; heading about z, pitch about y and roll about x in radians."""

    position_m: tuple[float, float, float]
    yaw_rad: float = 0.0
    pitch_rad: float = 0.0
    roll_rad: float = 0.0


class Motion(Protocol):
    """The way of a thing: a pose for every time of a clip, and a little before and after it."""

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`."""


class Route(Motion, Protocol):
    """A motion that knows the way it has covered, which wheels and legs go by."""

    def way_m(self, time_s: float) -> float:
        """Way along the path since some fixed moment, metres."""


@dataclass(frozen=True)
class Arc:
    """Constant speed on an arc: the pose at time t from the pose at time 0.

    Yaw rate 0 is a straight line, speed 0 a place.
    """

    start: Pose
    speed_m_s: float = 0.0
    yaw_rate_rad_s: float = 0.0

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`."""
        turned = self.yaw_rate_rad_s * time_s
        # Chord of the arc: speed * t * sin(h) / h in the direction start yaw + h, h half the turn.
        half = turned / 2
        # sin(h) / h tends to 1: on a straight line the chord is the way itself.
        chord = self.speed_m_s * time_s * (math.sin(half) / half if half else 1.0)
        heading = self.start.yaw_rad + half
        x, y, z = self.start.position_m
        moved = (x + chord * math.cos(heading), y + chord * math.sin(heading), z)
        start = self.start
        return Pose(moved, start.yaw_rad + turned, start.pitch_rad, start.roll_rad)

    def way_m(self, time_s: float) -> float:
        """Way along the arc since time 0, metres."""
        return self.speed_m_s * time_s


def ground_speed_m_s(motion: Motion, time_s: float) -> float:
    """Speed over ground along the own heading, m/s: negative for who reverses."""
    now, x, y = motion.at(time_s), *_moved_m(motion, time_s)
    return (x * math.cos(now.yaw_rad) + y * math.sin(now.yaw_rad)) / SPEED_STEP_S


def yaw_rate_rad_s(motion: Motion, time_s: float) -> float:
    """Rate of the heading, rad/s, counterclockwise from above."""
    half = SPEED_STEP_S / 2
    turned = motion.at(time_s + half).yaw_rad - motion.at(time_s - half).yaw_rad
    # A heading may be told as -pi here and as pi a moment later.
    return math.remainder(turned, math.tau) / SPEED_STEP_S


def _moved_m(motion: Motion, time_s: float) -> tuple[float, float]:
    """Way along x and y within `SPEED_STEP_S` about a time, metres."""
    half = SPEED_STEP_S / 2
    before, after = motion.at(time_s - half).position_m, motion.at(time_s + half).position_m
    return after[0] - before[0], after[1] - before[1]


def rotation(pose: Pose) -> np.ndarray:
    """Matrix [3, 3] from a pose's own axes to the world: roll about x, pitch about y, yaw about z.

    In this order, each turn by the right-hand rule, so that a positive pitch looks down and a
    positive roll lowers the right.
    """
    cy, sy = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    cp, sp = math.cos(pose.pitch_rad), math.sin(pose.pitch_rad)
    cr, sr = math.cos(pose.roll_rad), math.sin(pose.roll_rad)
    turned = np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])
    # Without roll the product below would only add rounding.
    return turned @ np.array([[1.0, 0.0, 0.0], [0.0, cr, -sr], [0.0, sr, cr]]) if sr else turned


def pose_of(turn: np.ndarray, position_m: tuple[float, float, float]) -> Pose:
    """The pose whose `rotation` is the matrix `turn` [3, 3]."""
    yaw = math.atan2(turn[1, 0], turn[0, 0])
    pitch = math.atan2(-turn[2, 0], math.hypot(turn[0, 0], turn[1, 0]))
    # About the axes that yaw and pitch have left: holds where the body stands on its nose as well.
    cos, sin = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(sin * turn[0, 2] - cos * turn[1, 2], cos * turn[1, 1] - sin * turn[0, 1])
    return Pose(position_m, yaw, pitch, roll)
