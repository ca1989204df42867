"""How legs go: footfalls that stay where they are set down, and the angles of the limbs above.

A leg is a chain of two segments, thigh and shank, between a hip and an ankle whose places are
known; its angles follow from the law of cosines. All angles are tabulated over a clip, so that
posing a limb is a few interpolations. Ways, not times, drive the feet: who slows down makes
shorter and fewer steps, and who stops ends with both feet on the ground.

Step length is walk ratio x cadence, the walk ratio being the same at all speeds but slow ones
(Murakami and Otaka, 2017): step = sqrt(ratio x speed), 0.71 m at 1.3 m/s and 1.8 steps/s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shotenv.world.geometry.meshes import Point
from shotenv.world.geometry.motion import Motion, Pose, Route
from shotenv.world.geometry.mover import attached
from unwrap.support import Range

Array = np.ndarray

WALK_RATIO_M_S = 0.384
"""Step length over cadence, 0.0064 m per step/min, of somebody 1.75 m tall."""
TABLE_S = 0.02
"""Between two instants of a posture's table: 1/25 of a step."""
MARGIN_S = 0.5
"""What a table holds before and after its clip: exposures begin before the first frame."""
STANDING_M_S = 0.02
"""Slower than this is standing."""
STANCE = 0.62
"""Time of a foot on the ground before and after it is passed, in steps: 62 % of a stride."""
LONGEST_STANCE = 0.42
"""Of the hip's height: no foot stays behind farther, so that fast runners leave the ground."""
USUAL_STEP_M = 0.7
"""Step of somebody 1.75 m tall at which foot and arms swing as far as said below."""
STRIKE_RAD, RISE_RAD = 0.35, 0.95
"""How far toes are raised where a heel strikes, and heels where toes leave the ground."""
STRAIGHTEST = 0.988
"""Longest a leg gets, of thigh and shank together: a knee that locks would jerk."""
ARM_RAD = 0.5
"""Swing of the arms to either side."""


@dataclass(frozen=True)
class Leg:
    """One leg of a walker, in the axes of its body.

    Attributes
    ----------
    thigh_m, shank_m, ankle_m : float
        Lengths, and height of the ankle over the sole.
    heel_m, toe_m : float
        Rear and front edge of the sole, from the ankle.
    hip_x_m, hip_y_m : float
        Where the hip is.
    turn : float
        When the foot falls, in steps: 0 and 1 for left and right.
    knee : int
        1 for a knee that bends forwards, -1 for one that bends backwards.
    """

    thigh_m: float
    shank_m: float
    ankle_m: float
    heel_m: float
    toe_m: float
    hip_x_m: float
    hip_y_m: float
    turn: float
    knee: int = 1

    @property
    def hip_z_m(self) -> float:
        """Height of the hip of who stands: knees are never quite straight."""
        return STRAIGHTEST * (self.thigh_m + self.shank_m) + self.ankle_m


@dataclass(frozen=True, eq=False)
class Posture:
    """Angles and shifts of a body over time: columns of numbers at equal steps."""

    start_s: float
    columns: tuple[tuple[float, ...], ...]

    def value(self, column: int, time_s: float) -> float:
        """A column at `time_s`, linear between two instants; beyond the table its nearest end."""
        numbers = self.columns[column]
        steps = min(max((time_s - self.start_s) / TABLE_S, 0.0), len(numbers) - 1.0)
        i = min(int(steps), len(numbers) - 2)
        return numbers[i] + (steps - i) * (numbers[i + 1] - numbers[i])


SHIFT_X, SHIFT_Z, LEAN = 0, 1, 2
"""Columns of every posture: shift of the hips from `root_m`, and pitch of what they carry."""


@dataclass(frozen=True)
class Segment:
    """Motion of one segment of a chain that hangs from a body's hips.

    Attributes
    ----------
    body : Motion
    posture : Posture
    root_m : (x, y, z)
        Where the chain begins, before the hips shift.
    above : tuple of (length, column)
        Segments between the root and this one: how far each hangs down, and its pitch.
    column : int
        Pitch of this segment; 0 hangs straight down.
    """

    body: Motion
    posture: Posture
    root_m: Point
    above: tuple[tuple[float, int], ...]
    column: int

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`."""
        value = self.posture.value
        x, y, z = self.root_m
        x, z = x + value(SHIFT_X, time_s), z + value(SHIFT_Z, time_s)
        for length_m, column in self.above:
            pitch = value(column, time_s)
            x, z = x - length_m * math.sin(pitch), z - length_m * math.cos(pitch)
        return attached(self.body.at(time_s), (x, y, z), value(self.column, time_s))


def table_times(span_s: Range) -> Array:
    """Instants [T] of a table for a clip from span_s[0] to span_s[1]."""
    return np.arange(span_s[0] - MARGIN_S, span_s[1] + MARGIN_S + TABLE_S, TABLE_S)


def walking_posture(
    route: Route, span_s: Range, legs: Sequence[Leg], height_m: float, phase: float
) -> Posture:
    """Posture of a walker: hips, lean, an arm and then thigh, shank and foot for each leg.

    Parameters
    ----------
    route : Route
        Of the point on the ground below the hips.
    legs : sequence of Leg
    height_m : float
        Whose steps it makes: those of a person as tall.
    phase : float
        Steps that it has made at the start, and where it is in its swaying.

    Returns
    -------
    Posture
        Columns shift x, shift z, lean, one arm for each leg, and three for each leg, in order.
    """
    times = table_times(span_s)
    ways = np.array([route.way_m(time) for time in times])
    speed = np.abs(np.gradient(ways, TABLE_S))
    # Longer legs make longer and slower steps at one Froude number (Alexander and Jayes, 1983).
    factor = math.sqrt(WALK_RATIO_M_S) * (height_m / 1.75) ** 0.75
    walk = _Walk(step_phase(speed, factor, phase), ways, factor * np.sqrt(speed))
    size = height_m / 1.75
    stride = np.minimum(walk.steps_m / (USUAL_STEP_M * size), 1.5)
    stance = min(STANCE, LONGEST_STANCE * legs[0].hip_z_m / max(walk.steps_m.max(), 1e-6))
    feet = [foot_path(walk, leg, stance, size) for leg in legs]
    in_air = [np.abs(_since_fall(walk, leg)) > stance for leg in legs]
    still = np.clip(1.0 - speed / 0.3, 0.0, 1.0)
    shift_x = 0.015 * size * still * np.sin(2 * np.pi * (times / 5.3 + phase))
    away = [x - ways - leg.hip_x_m - shift_x for leg, (x, _, _) in zip(legs, feet, strict=True)]
    # How far a leg reaches down where its foot is so far ahead.
    spans = [
        np.sqrt(np.maximum((STRAIGHTEST * (leg.thigh_m + leg.shank_m)) ** 2 - dx**2, 0.0))
        for leg, dx in zip(legs, away, strict=True)
    ]
    shift_z = _bob(walk, stance, legs[0].hip_z_m)
    for leg, (_, z, _), span, lifted in zip(legs, feet, spans, in_air, strict=True):
        # Hips sink where a foot on the ground would be out of reach.
        shift_z = np.where(lifted, shift_z, np.minimum(shift_z, z + span - leg.hip_z_m))
    lean = 0.03 * stride + 0.015 * still * np.sin(2 * np.pi * (times / 3.7 + 2.0 * phase))
    arms = [lean - ARM_RAD * stride * np.sin(np.pi * (walk.phase - leg.turn)) for leg in legs]
    columns = [shift_x, shift_z, lean, *arms]
    for leg, (_, z, pitch), dx, span in zip(legs, feet, away, spans, strict=True):
        # A foot in the air comes along: who runs lifts the heel that stays behind.
        below = np.minimum(leg.hip_z_m + shift_z - z, span)
        columns += [*two_bones(leg, dx, below), pitch]
    return Posture(float(times[0]), tuple(tuple(column.tolist()) for column in columns))


def step_phase(speed: Array, factor: float, phase: float) -> Array:
    """Steps [T] made until each instant, of who walks at `speed` [T] m/s.

    Feet fall at whole numbers. Halfway between two both feet are on the ground: there everybody
    starts and stops, for which a walk from standing to standing is cut to a whole number of steps.
    """
    made = np.sqrt(speed) / factor * TABLE_S
    moving = speed > STANDING_M_S
    made[~moving] = 0.0
    bounds = [0, *(np.flatnonzero(np.diff(moving)) + 1).tolist(), len(speed)]
    start = phase if moving[0] else 0.5
    for first, end in pairwise(bounds):
        if moving[first] and end < len(speed):
            total = float(made[first:end].sum())
            if first:
                made[first:end] *= max(1, round(total)) / total
            else:
                start = 0.5 - total
    return start + np.concatenate([[0.0], np.cumsum(made[:-1])])


@dataclass(frozen=True, eq=False)
class _Walk:
    """Steps made, way in metres and usual step length in metres, each [T]."""

    phase: Array
    ways_m: Array
    steps_m: Array

    def way_after(self, phase: Array) -> Array:
        """Way at which so many steps are made, going on steadily beyond both ends."""
        way = np.interp(phase, self.phase, self.ways_m)
        before = np.minimum(phase - self.phase[0], 0.0) * self.steps_m[0]
        after = np.maximum(phase - self.phase[-1], 0.0) * self.steps_m[-1]
        return way + before + after


def foot_path(walk: _Walk, leg: Leg, stance: float, size: float) -> tuple[Array, Array, Array]:
    """Ankle (x along the way, z) and pitch of a foot, each [T].

    On the ground the foot turns about the rear edge of its sole, then lies flat, then turns about
    the front edge: whichever edge it is does not move. In the air it goes from one to the next.
    """
    since = _since_fall(walk, leg)
    fall = walk.phase - since

    def planted(fall: Array, since: Array) -> tuple[Array, Array, Array]:
        """Ankle and pitch of the foot that is passed after `fall` steps, `since` steps later."""
        step = (walk.way_after(fall + 1.0) - walk.way_after(fall - 1.0)) / 2.0
        stride = np.minimum(step / (USUAL_STEP_M * size), 1.5)
        share = since / stance
        strike, rise = _ease((-0.73 - share) / 0.27), _ease((share - 0.24) / 0.76)
        pitch = stride * (RISE_RAD * rise - STRIKE_RAD * strike)
        edge = np.where(pitch > 0.0, leg.toe_m, leg.heel_m)
        sin, cos = np.sin(pitch), np.cos(pitch)
        # Feet are on the ground longer behind the body than before it.
        x = walk.way_after(fall) - 0.19 * stance * step + leg.hip_x_m
        return x + edge * (1.0 - cos) + leg.ankle_m * sin, edge * sin + leg.ankle_m * cos, pitch

    on_ground = planted(fall, np.clip(since, -stance, stance))
    last = np.where(since > 0.0, fall, fall - 2.0)
    leaves = planted(last, np.full_like(since, stance))
    lands = planted(last + 2.0, np.full_like(since, -stance))
    share = np.clip((walk.phase - last - stance) / (2.0 - 2.0 * stance), 0.0, 1.0)
    eased = _ease(share)
    # Toes must clear the ground while the foot turns level again.
    step = np.minimum(lands[0] - leaves[0], 2.0 * size)
    lift = 0.018 * step**2 * np.sin(np.pi * share)
    in_air = [a + eased * (b - a) for a, b in zip(leaves, lands, strict=True)]
    swings = np.abs(since) > stance
    x, z, pitch = (np.where(swings, a, g) for a, g in zip(in_air, on_ground, strict=True))
    return x, np.where(swings, z + lift, z), pitch


def _since_fall(walk: _Walk, leg: Leg) -> Array:
    """Steps [T] made since the body passed, or until it will pass, the foot that is nearest."""
    since = walk.phase - leg.turn
    return since - 2.0 * np.round(since / 2.0)


def _bob(walk: _Walk, stance: float, hip_z_m: float) -> Array:
    """How far hips are below where they are of who stands [T], at most."""
    # Legs as stiff as compasses would drop by step^2 / (8 leg) between two steps; feet that roll
    # off save a third.
    sway = np.minimum(0.62 * walk.steps_m**2 / (8.0 * hip_z_m), 0.06 * hip_z_m)
    # Who runs is lowest in the middle of a step and not between two.
    walks = np.clip((stance - 0.5) / (STANCE - 0.5), -1.0, 1.0)
    return -sway * (1.0 - walks * np.cos(2 * np.pi * walk.phase)) / 2.0


def two_bones(leg: Leg, ahead: Array, below: Array) -> tuple[Array, Array]:
    """Pitch of thigh and shank [T] of a leg whose ankle is so far ahead of and below its hip."""
    thigh, shank = leg.thigh_m, leg.shank_m
    farthest = 0.9999 * (thigh + shank)
    distance = np.clip(np.hypot(ahead, below), abs(thigh - shank) + 1e-3, farthest)
    towards = np.arctan2(ahead, below)
    cosine = (thigh**2 + distance**2 - shank**2) / (2.0 * thigh * distance)
    first = towards + leg.knee * np.arccos(np.clip(cosine, -1.0, 1.0))
    second = np.arctan2(
        distance * np.sin(towards) - thigh * np.sin(first),
        distance * np.cos(towards) - thigh * np.cos(first),
    )
    # Positive pitch swings what hangs down backwards.
    return -first, -second


def _ease(share: Array) -> Array:
    """From 0 to 1 without a jerk at either end, constant beyond."""
    u = np.clip(share, 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


def pedalling_posture(
    route: Route,
    span_s: Range,
    legs: Sequence[Leg],
    hip_z_m: float,
    bottom_m: Point,
    crank_m: float,
    turn_m: float,
) -> Posture:
    """Posture of a cyclist, whose cranks turn once in `turn_m` of way.

    Columns are those of `walking_posture`. Hips keep still at `hip_z_m`; feet are on pedals at
    `crank_m` from the cranks' axle `bottom_m`, half a turn apart.
    """
    times = table_times(span_s)
    ways = np.array([route.way_m(time) for time in times])
    zero = np.zeros_like(times)
    columns = [zero] * (3 + len(legs))
    for leg in legs:
        angle = 2 * np.pi * ways / turn_m + np.pi * leg.turn
        ahead = bottom_m[0] + crank_m * np.sin(angle) - leg.hip_x_m
        pedal_z = bottom_m[2] + crank_m * np.cos(angle)
        columns += [*two_bones(leg, ahead, hip_z_m - pedal_z - leg.ankle_m), zero]
    return Posture(float(times[0]), tuple(tuple(column.tolist()) for column in columns))
