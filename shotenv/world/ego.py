"""How the ego drives in a clip: its speeds, its way, its body, and how the road bends."""

from __future__ import annotations

import math

import numpy as np

from shotenv.config import WorldConfig
from shotenv.world.families import Place
from shotenv.world.geometry import (
    Body,
    Curve,
    Drive,
    SpeedProfile,
    change_s,
    materials as m,
    speeds_in_turn,
)
from unwrap.support import Range

LONGEST_DRIVE_M = 1500.0
"""Longer worlds are not drawn: float32 corners keep .1 mm up to there."""
CAMERA_HEIGHT_M = (0.6, 1.2)
"""From a car's bumper to its wind screen."""
CAMERA_PITCH_RAD = (-0.03, 0.03)
"""1.7 degrees up or down; assumed."""
ACCELERATION_M_S2 = (0.6, 3.0)
"""Of changes of speed: comfortable ones are below 2, firm braking is 3; assumed range."""
CORNERING_M_S2 = 2.5
"""Most sideways acceleration in a bend; drivers stay below 3 or 4 [assumed]."""
BEND_SHARE = 0.7
"""Share of the roads that bend, where a place has bends; assumed."""
WIDEST_WEAVE_M = 0.2
"""Amplitude of the swing about the lane's middle: the lane stays free twice as wide."""
LANE_MANNERS = {
    "cruise": 0.42, "change": 0.22, "stop": 0.12, "start": 0.10, "queue": 0.11, "stand": 0.03,
}  # fmt: skip
PARKING_MANNERS = {
    "nose in": 0.42,
    "back out": 0.2,
    "back in": 0.18,
    "pull out": 0.17,
    "stand": 0.03,
}
"""How often somebody drives so; assumed."""
TURNING_CURVATURE = (0.12, 0.18)
"""Of a car that parks, 1/m: radii of 5.5 to 8 m."""
TONES_HZ = (1.0, 15.0)
"""A body's own bounce and pitch are at 1 to 2 Hz, its wheels' at 10 to 15 Hz."""
NOD_RAD_S2_M = (0.005, 0.009)
"""Pitch for each m/s2: .3 to .5 degrees [assumed]."""


def draw_ego(
    rng: np.random.Generator, place: Place, duration_s: float, config: WorldConfig
) -> tuple[Drive, Curve]:
    """The ego's drive, told along the road, and the road.

    Raises
    ------
    ValueError
        The configured slowest speed drives out of the longest world within the clip.
    """
    low, high = config.speed_m_s
    if low * duration_s > LONGEST_DRIVE_M:
        raise ValueError(
            f"speed_m_s is ({low:g}, {high:g}); expected at most {LONGEST_DRIVE_M / duration_s:g} "
            f"at its low end: a clip of {duration_s:g} s is driven in {LONGEST_DRIVE_M:g} m"
        )
    limits = low, min(high, LONGEST_DRIVE_M / duration_s)
    body = draw_body(rng, place.roughness)
    height, pitch = float(rng.uniform(*CAMERA_HEIGHT_M)), float(rng.uniform(*CAMERA_PITCH_RAD))
    # Who may not stand cannot change gear either.
    if place.parks and low == 0:
        profile, way = draw_parking(rng, place.speed_m_s, limits, duration_s)
        return Drive(profile, way, height, pitch, body), Curve()
    corner_m = place.corner_m if rng.random() < place.corner_share else None
    if corner_m is not None and low**2 <= CORNERING_M_S2 * corner_m[0]:
        profile, road = draw_corner(rng, corner_m, place.speed_m_s, limits, duration_s)
    else:
        profile = draw_profile(rng, place.speed_m_s, limits, duration_s)
        road = draw_bends(rng, place.bend_m, profile, duration_s)
    # Drivers swing about the middle of their lane once in 5 to 9 s and 15 m.
    length = 15.0 + profile.highest_m_s * rng.uniform(5.0, 9.0)
    weave = WIDEST_WEAVE_M * rng.uniform(), length, rng.uniform(0.0, math.tau)
    return Drive(profile, Curve(), height, pitch, body, *map(float, weave)), road


def draw_body(rng: np.random.Generator, roughness: float) -> Body:
    """Springs of a car, and vibration of a few millimetres and tenths of a degree on a road.

    `roughness` is 1 on asphalt and more on bare ground.
    """
    tones = []
    for _ in range(6):
        frequency = m.log_uniform(rng, TONES_HZ)
        # Slow swings are wide and fast ones small: amplitudes fall as one over the frequency.
        scale = roughness * rng.uniform(0.4, 1.6) / (1.0 + 0.3 * frequency)
        heave, pitch, roll = (
            float(scale * most * rng.uniform(0.5, 1.0)) for most in (2e-3, 1.5e-3, 1e-3)
        )
        tones.append((frequency, heave, pitch, roll, float(rng.uniform(0.0, math.tau))))
    return Body(float(rng.uniform(*NOD_RAD_S2_M)), tuple(tones))


def draw_profile(
    rng: np.random.Generator, usual: Range, limits: Range, duration_s: float
) -> SpeedProfile:
    """Speeds in a lane: cruising, changing, stopping, starting, in a queue, seldom standing.

    The configured `limits` have the last word: a place of slow cars is then driven faster.
    """
    manner = rng.choice(list(LANE_MANNERS), p=list(LANE_MANNERS.values()))
    wish, other = rng.uniform(*usual), rng.uniform(0.2, 0.65)
    # Slower than a walk would look like standing.
    wish = max(wish, min(0.5, usual[1]))

    def gently() -> float:
        return float(rng.uniform(*ACCELERATION_M_S2))

    def kept(speed: float) -> float:
        return float(np.clip(speed, *limits))

    fast, slow, stop = kept(wish), kept(wish * other), kept(0.0)
    # Where in the clip it begins; what begins a little before time 0 is seen halfway.
    begin = float(rng.uniform(-0.3, 0.55)) * min(duration_s, 6.0)
    if manner == "cruise":
        count = int(duration_s / 3.0) + 1
        holds = [
            (0.6 * gently(), kept(wish * rng.uniform(0.8, 1.1)), rng.uniform(1.0, 5.0))
            for _ in range(count)
        ]
        return speeds_in_turn(fast, holds, begin)
    if manner == "change":
        first, then = (fast, slow) if rng.random() < 0.5 else (slow, fast)
        return speeds_in_turn(first, [(gently(), then, 0.0)], begin)
    if manner == "stop":
        braking, again = gently(), gently()
        # At least half of the braking is in the clip.
        begin = max(begin, -0.5 * change_s(fast, stop, braking))
        return speeds_in_turn(
            fast, [(braking, stop, rng.uniform(1.5, 6.0)), (again, slow, 0.0)], begin
        )
    if manner == "start":
        return speeds_in_turn(stop, [(gently(), fast, 0.0)], begin)
    if manner == "queue":
        creep = kept(min(wish, rng.uniform(1.0, 5.0)))
        cycle = [
            (gently(), speed, rng.uniform(0.4, 2.5))
            for _ in range(int(duration_s / 2.0) + 1)
            for speed in (creep, stop)
        ]
        return speeds_in_turn(stop, cycle, min(begin, 0.4 * duration_s))
    return SpeedProfile(stop)


def draw_corner(
    rng: np.random.Generator, radius_m: Range, usual: Range, limits: Range, duration_s: float
) -> tuple[SpeedProfile, Curve]:
    """A turn by 90 degrees: the ego slows, turns and goes on; the road is straight elsewhere.

    Behind the corner the road runs along +x, so that what stands there square to it is square to
    the world's axes.
    """
    radius, side = float(rng.uniform(*radius_m)), float(rng.choice([-1.0, 1.0]))
    turning = float(np.clip(min(rng.uniform(2.0, 5.0), max(usual[1], 0.8)), *limits))
    turning = min(turning, math.sqrt(CORNERING_M_S2 * radius))
    before, after = (float(np.clip(max(rng.uniform(*usual), turning), *limits)) for _ in range(2))
    # Clothoids in and out, as a steering wheel is turned, with an arc between.
    entry = 0.6 * radius
    length = radius * math.pi / 2 + entry
    braking, leaving = (float(rng.uniform(*ACCELERATION_M_S2)) for _ in range(2))
    held_s = length / max(turning, 0.1)
    reached_s = float(rng.uniform(-0.5 * held_s, 0.6 * duration_s))
    profile = speeds_in_turn(
        before,
        [(braking, turning, held_s), (leaving, after, 0.0)],
        reached_s - change_s(before, turning, braking),
    )
    start, curvature = profile.distance_m(reached_s), side / radius
    knots = ((start, 0.0), (start + entry, curvature), (start + length - entry, curvature),
             (start + length, 0.0))  # fmt: skip
    return profile, Curve(knots, origin_m=start + length)


def draw_bends(
    rng: np.random.Generator, radius_m: Range | None, profile: SpeedProfile, duration_s: float
) -> Curve:
    """Bends one after the other from behind the ego to beyond what it will see.

    No bend is so tight that the ego's highest speed would throw it out.
    """
    if radius_m is None or rng.random() > BEND_SHARE:
        return Curve()
    low = max(radius_m[0], profile.highest_m_s**2 / CORNERING_M_S2)
    bounds = low, max(radius_m[1], 1.5 * low)
    knots: list[tuple[float, float]] = []
    at, end = -80.0 + rng.uniform(0.0, 40.0), profile.distance_m(duration_s) + 150.0
    while at < end:
        radius, side = m.log_uniform(rng, bounds), rng.choice([-1.0, 1.0])
        entry = min(30.0, radius * rng.uniform(0.2, 0.4))
        # At most 69 degrees (1.2 rad) at a time: a road that turned back would run through itself.
        arc = min(rng.uniform(8.0, 80.0), radius * rng.uniform(0.2, 0.8))
        curvature = float(side / radius)
        for step, value in ((0.0, 0.0), (entry, curvature), (arc, curvature), (entry, 0.0)):
            at += step
            knots.append((float(at), value))
        at += rng.uniform(3.0, 60.0)
    return Curve(tuple(knots))


def draw_parking(
    rng: np.random.Generator, usual: Range, limits: Range, duration_s: float
) -> tuple[SpeedProfile, Curve]:
    """Into a parking place or out of it, forwards or backwards."""
    manner = rng.choice(list(PARKING_MANNERS), p=list(PARKING_MANNERS.values()))
    side = float(rng.choice([-1.0, 1.0]))
    curvature = side * float(rng.uniform(*TURNING_CURVATURE))
    speed = float(np.clip(rng.uniform(0.4, max(usual[1], 0.4)), *limits))
    starting, braking = float(rng.uniform(0.5, 1.5)), float(rng.uniform(0.6, 2.0))
    begin = float(rng.uniform(-0.5, 0.5)) * min(duration_s, 3.0)
    if manner == "nose in":
        # A little askew, straightening out; it stops within the clip or goes on.
        stop = begin + rng.uniform(0.2, 1.5) * duration_s
        profile = speeds_in_turn(speed, [(braking, 0.0, 0.0)], float(stop))
        return profile, _turn(-8.0, 0.0, 0.4 * curvature * rng.uniform())
    if manner == "back out":
        profile = speeds_in_turn(0.0, [(starting, speed, rng.uniform(3.0, 9.0)),
                                       (braking, 0.0, 0.0)], begin)  # fmt: skip
        straight = float(rng.uniform(1.0, 4.0))
        # It may be on its way out already when the clip begins.
        leaves = profile.distance_m(min(begin, 0.0))
        return profile, _turn(straight, straight + 7.0, curvature, reverse_from_m=leaves)
    if manner == "back in":
        # Past the place, then backwards into it; the gear is changed within the clip.
        change = float(rng.uniform(0.1, 0.5)) * duration_s
        profile = speeds_in_turn(
            speed,
            [(braking, 0.0, rng.uniform(0.3, 1.0)), (starting, speed, rng.uniform(3.0, 8.0)),
             (braking, 0.0, 0.0)],
            change - change_s(speed, 0.0, braking),
        )  # fmt: skip
        cusp = profile.distance_m(change)
        return profile, _turn(cusp + 0.5, cusp + 9.0, curvature, reverse_from_m=cusp)
    if manner == "pull out":
        profile = speeds_in_turn(speed, [(starting, min(1.5 * speed, limits[1]), 0.0)], begin)
        straight = float(rng.uniform(0.0, 3.0))
        return profile, _turn(straight, straight + 8.0, curvature)
    return SpeedProfile(0.0), Curve()


def _turn(first: float, last: float, curvature: float, reverse_from_m: float = math.inf) -> Curve:
    """An arc with short clothoids at its ends."""
    ease = min(1.5, (last - first) / 3)
    knots = ((first, 0.0), (first + ease, curvature), (last - ease, curvature), (last, 0.0))
    return Curve(knots, 0.0, reverse_from_m)
