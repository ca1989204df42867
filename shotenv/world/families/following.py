"""Speeds that react: who drives brakes for what is ahead, who walks waits before a road.

Everything that a site holds already is known over the whole clip, the ego included, so that a
speed profile can be integrated against it before the clip begins.
"""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Along, Arc, Pose, Site
from unwrap.support import Range

# The intelligent-driver model of Treiber, Hennecke and Helbing (2000), with their values.
HEADWAY_S = 1.6
JAM_GAP_M = 2.0
ACCELERATION_M_S2 = 0.73
COMFORTABLE_BRAKING_M_S2 = 1.67
EXPONENT = 4
HARDEST_BRAKING_M_S2 = 6.0
"""On a dry road; assumed."""
BESIDE_M = 0.3
"""What keeps farther off than this to the side is passed at full speed; assumed."""
NOTICED_S = 3.0
"""How long before somebody steps into a lane its drivers expect it; assumed."""
WALKING_M_S2 = 1.0
"""How fast walkers get up to their speed and stop; assumed."""


def with_speeds(path: Arc, start_s: float, step_s: float, speeds: np.ndarray) -> Along:
    """A path gone along at speeds [T] m/s, linear between instants at equal steps."""
    ways = np.concatenate([[0.0], np.cumsum((speeds[1:] + speeds[:-1]) / 2 * step_s)])
    return Along(path, start_s, step_s, tuple(ways.tolist()), tuple(speeds.tolist()))


def behind_others(
    site: Site,
    start: Pose,
    ends_m: Range,
    half_width_m: float,
    wish_m_s: float,
    red: tuple[float, float] | None = None,
) -> Along:
    """The way of a driver who goes straight on and follows what is ahead.

    Parameters
    ----------
    site : Site
        What it holds is driven behind, or stopped for.
    start : Pose
        Of the vehicle's origin at time 0.
    ends_m : (rear, nose)
        Of the vehicle, from its origin.
    half_width_m : float
    wish_m_s : float
        Speed on a free road.
    red : (way, time) or None
        A line that must not be driven over before a time, metres from the start and seconds.
    """
    times = site.times
    step_s = float(times[1] - times[0])
    rears, fronts = _in_the_way(site, start, half_width_m + BESIDE_M)
    if red is not None:
        line = np.where(times < red[1], red[0], np.inf)[None]
        rears, fronts = np.concatenate([rears, line]), np.concatenate([fronts, line])
    with np.errstate(invalid="ignore"):
        paces = np.nan_to_num(np.gradient(rears, step_s, axis=1), posinf=0.0, neginf=0.0)
    way, speeds = 0.0, np.empty(len(times))
    speed = wish_m_s
    for i in range(len(times)):
        # What is beside the driver, or behind, is not followed.
        ahead = fronts[:, i] > way + ends_m[0]
        gaps = np.where(ahead, rears[:, i] - (way + ends_m[1]), np.inf)
        first = int(gaps.argmin()) if len(gaps) else -1
        gap, pace = (float(gaps[first]), float(paces[first, i])) if len(gaps) else (np.inf, 0.0)
        if i == 0 and np.isfinite(gap):
            # Nobody starts a clip faster than they could brake in comfort.
            room = max(gap - JAM_GAP_M, 0.0)
            speed = min(speed, max(pace, 0.0) + np.sqrt(2 * COMFORTABLE_BRAKING_M_S2 * room))
        speeds[i] = speed
        new = max(0.0, speed + step_s * acceleration(speed, wish_m_s, gap, speed - pace))
        way += step_s * (speed + new) / 2
        speed = new
    return with_speeds(Arc(start, 1.0), float(times[0]), step_s, speeds)


def acceleration(speed: float, wish: float, gap_m: float, closing: float) -> float:
    """Of a driver in m/s2, by the intelligent-driver model; `closing` is positive when faster."""
    if wish <= 0.0:
        return -HARDEST_BRAKING_M_S2
    root = 2 * np.sqrt(ACCELERATION_M_S2 * COMFORTABLE_BRAKING_M_S2)
    wanted = JAM_GAP_M + max(0.0, speed * HEADWAY_S + speed * closing / root)
    pressing = (wanted / max(gap_m, 0.1)) ** 2
    free = ACCELERATION_M_S2 * (1.0 - (speed / wish) ** EXPONENT - pressing)
    return max(-HARDEST_BRAKING_M_S2, float(free))


def _in_the_way(site: Site, start: Pose, half_m: float) -> tuple[np.ndarray, np.ndarray]:
    """Near and far end [K, T] of what is in a lane ahead, metres of way; infinite when off it."""
    cos, sin = np.cos(start.yaw_rad), np.sin(start.yaw_rad)
    step_s = site.times[1] - site.times[0]
    notice = int(np.ceil(NOTICED_S / step_s))
    rears, fronts = [], []
    for taken in site.taken:
        corners = taken[:, [0, 0, 1, 1], [0, 0, 0, 0]], taken[:, [0, 1, 0, 1], [1, 1, 1, 1]]
        x, y = corners[0] - start.position_m[0], corners[1] - start.position_m[1]
        along, across = x * cos + y * sin, y * cos - x * sin
        inside = (across.min(axis=1) < half_m) & (across.max(axis=1) > -half_m)
        if not inside.any():
            continue
        rear, front = along.min(axis=1), along.max(axis=1)
        if len(taken) > 1:
            # In the lane at any instant within the notice.
            until = np.minimum(np.arange(len(inside)) + notice + 1, len(inside))
            entered = np.concatenate([[0], np.cumsum(inside)])
            inside = entered[until] > entered[:-1]
        rear = np.where(inside, rear, np.inf)
        # Who comes closer is awaited where it will be closest: two that stop nose to nose never
        # touch, one that drives up to where the other is now is run into.
        rear = np.where(inside, np.minimum.accumulate(rear[::-1])[::-1], np.inf)
        rears.append(np.broadcast_to(rear, site.times.shape))
        fronts.append(np.broadcast_to(np.where(inside, front, -np.inf), site.times.shape))
    ends_m = to_the_wall(site, start)
    if np.isfinite(ends_m):
        rears.append(np.full(site.times.shape, ends_m))
        fronts.append(np.full(site.times.shape, np.inf))
    if not rears:
        nothing = np.empty((0, len(site.times)))
        return nothing, nothing
    return np.array(rears), np.array(fronts)


def to_the_wall(site: Site, start: Pose) -> float:
    """Way along the road, either way, until the room ends, metres; infinite under the sky."""
    towards = np.cos(start.yaw_rad)
    wall = site.room[1 if towards > 0 else 0, 0]
    return float(abs(wall - start.position_m[0])) if abs(towards) > 0.7 else np.inf


def ahead_of_ego(
    site: Site, path: Arc, reaction_s: float, unrest: float, period_s: float, phase: float
) -> Along:
    """The way of somebody whom the ego follows: what it does, the ego does a little later.

    Newell's car following (2002) read backwards: the ego repeats the leader's way after its
    reaction time. `unrest` is the share by which the leader's speed wavers about the ego's.
    """
    step_s = float(site.times[1] - site.times[0])
    later = [site.ego.at(time + reaction_s).position_m for time in site.times]
    x, y, _ = np.gradient(np.array(later), step_s, axis=0).T
    pace = np.hypot(x, y)
    waver = 1.0 + unrest * np.sin(2 * np.pi * (site.times / period_s + phase))
    return with_speeds(path, float(site.times[0]), step_s, pace * waver)


def walk_across(site: Site, path: Arc, begin_s: float, length_m: float, speed_m_s: float) -> Along:
    """Who stands at the start of a path, goes along it from `begin_s` on, and stands at its end."""
    # As fast as the way is long enough for.
    speed = min(speed_m_s, float(np.sqrt(WALKING_M_S2 * length_m)))
    end_s = begin_s + length_m / speed + speed / WALKING_M_S2
    step_s = float(site.times[1] - site.times[0])
    # From before the clip, if the walk has begun by then.
    before = int(np.ceil(max(0.0, -begin_s) / step_s)) + 1
    times = (np.arange(len(site.times) + before) - before) * step_s
    ramp = WALKING_M_S2 * np.minimum(times - begin_s, end_s - times)
    return with_speeds(path, float(times[0]), step_s, np.clip(ramp, 0.0, speed))


def with_pause(site: Site, path: Arc, speed_m_s: float, stop_s: float, go_s: float) -> Along:
    """Who walks along a path, stops at `stop_s`, as to look at something, and goes on at `go_s`."""
    step_s = float(site.times[1] - site.times[0])
    ramp = WALKING_M_S2 * np.maximum(stop_s - site.times, site.times - go_s)
    speeds = np.clip(ramp, 0.0, speed_m_s)
    return with_speeds(path, float(site.times[0]), step_s, speeds)
