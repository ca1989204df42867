"""Ways through a scene: poses over time, or way points and a speed over time, as motions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shotenv.config import OwnClip
from shotenv.world.geometry import Motion, Pose

STEPS_A_LEG = 64
"""Points of a curve between two way points, straight between each other."""


@dataclass(frozen=True)
class PosedWay:
    """Poses over time, smooth in between.

    Attributes
    ----------
    times_s : float64 [N]
    values, slopes : float64 [N, 6]
        Place in metres, yaw, pitch and roll in radians, at each time; and their rates.
    """

    times_s: np.ndarray
    values: np.ndarray
    slopes: np.ndarray

    @classmethod
    def of(cls, times_s: np.ndarray, places_m: np.ndarray, angles_rad: np.ndarray) -> PosedWay:
        """From times [N], places [N, 3] and angles [N, 3], which turn the shorter way round."""
        values = np.concatenate([places_m, np.unwrap(angles_rad, axis=0)], axis=1)
        return cls(times_s, values, monotone_slopes(times_s, values))

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`; before and after its times it goes on as it began and ended."""
        x, y, z, *angles = (
            float(v) for v in hermite(self.times_s, self.values, self.slopes, time_s)
        )
        return Pose((x, y, z), *angles)


@dataclass(frozen=True)
class DrivenWay:
    """A smooth curve through way points, driven with a speed over time, heading along it.

    Attributes
    ----------
    along_m : float64 [P]
        Length of the curve up to each of its points.
    values : float64 [P, 5]
        Place in metres, heading and pitch in radians, at each point.
    times_s, speed_m_s, driven_m : float64 [N]
        Where the speed is told, it, and the way driven until then; it is linear in between.
    """

    along_m: np.ndarray
    values: np.ndarray
    times_s: np.ndarray
    speed_m_s: np.ndarray
    driven_m: np.ndarray

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`; before and after its times the speed is that at the ends."""
        along = self._driven(time_s)
        x, y, z, yaw, pitch = (float(np.interp(along, self.along_m, v)) for v in self.values.T)
        beyond = along - float(np.clip(along, 0.0, self.along_m[-1]))
        ahead = beyond * math.cos(pitch)
        x, y = x + ahead * math.cos(yaw), y + ahead * math.sin(yaw)
        return Pose((x, y, z - beyond * math.sin(pitch)), yaw, pitch)

    def _driven(self, time_s: float) -> float:
        """Way until a time, metres."""
        i = int(np.clip(np.searchsorted(self.times_s, time_s) - 1, 0, len(self.times_s) - 2))
        t = time_s - self.times_s[i]
        span = self.times_s[i + 1] - self.times_s[i]
        inside = float(np.clip(t, 0.0, span))
        rate = (self.speed_m_s[i + 1] - self.speed_m_s[i]) / span
        speed_then = self.speed_m_s[i] + rate * inside
        way = self.driven_m[i] + inside * (self.speed_m_s[i] + speed_then) / 2
        return float(way + (t - inside) * speed_then)


def motion_of(clip: OwnClip) -> Motion:
    """The way of a car's reference in a clip, whose first time is 0 s.

    Raises
    ------
    ValueError
        The speed drives further than the way points lead, or back beyond the first.
    """
    if clip.poses:
        first_s = clip.poses[0].time_s
        return PosedWay.of(
            np.array([pose.time_s - first_s for pose in clip.poses]),
            np.array([pose.position_m for pose in clip.poses]),
            np.radians([(pose.yaw_deg, pose.pitch_deg, pose.roll_deg) for pose in clip.poses]),
        )
    return _driven(clip)


def _driven(clip: OwnClip) -> DrivenWay:
    points = np.array(clip.waypoints_m)
    # By the length of its chords a curve is even, however far apart its points are.
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    slopes = monotone_slopes(chord, points)
    fine = np.concatenate(
        [np.linspace(a, b, STEPS_A_LEG + 1)[:-1] for a, b in pairwise(chord)] + [chord[-1:]]
    )
    places = np.array([hermite(chord, points, slopes, s) for s in fine])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    x, y, z = np.gradient(places, along, axis=0).T
    yaw = np.unwrap(np.arctan2(y, x))
    times, speed = np.array(clip.speed_m_s).T
    legs = np.diff(times) * (speed[1:] + speed[:-1]) / 2
    driven = np.concatenate([[0.0], np.cumsum(legs)])
    way = DrivenWay(
        along, np.column_stack([places, yaw, -np.arctan2(z, np.hypot(x, y))]),
        times - times[0], speed, driven,
    )  # fmt: skip
    reached = [way._driven(t) for t in np.linspace(0.0, way.times_s[-1], 1001)]
    if min(reached) < -1e-6 or max(reached) > along[-1] + 1e-6:
        raise ValueError(
            f"speed_m_s drives from {min(reached):.3f} to {max(reached):.3f} m along waypoints_m; "
            f"expected 0 to {along[-1]:.3f} m, their length"
        )
    return way


def hermite(at: np.ndarray, values: np.ndarray, slopes: np.ndarray, position: float) -> np.ndarray:
    """Cubic through values [N, K] with slopes [N, K] at N positions; straight beyond the ends."""
    inside = float(np.clip(position, at[0], at[-1]))
    i = int(np.clip(np.searchsorted(at, inside) - 1, 0, len(at) - 2))
    span = at[i + 1] - at[i]
    t = (inside - at[i]) / span
    low, high = values[i], values[i + 1]
    rise = high - low
    ease = t * t * (3 - 2 * t)
    curve = low + ease * rise
    curve = curve + span * t * (1 - t) * ((1 - t) * slopes[i] - t * slopes[i + 1])
    end = 0 if position < inside else len(at) - 1
    return curve + (position - inside) * slopes[end]


def monotone_slopes(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes [N, K] of a cubic that rises and falls only where the values [N, K] do.

    Fritsch and Butland (1984): where two values are the same, the curve stands still between.
    """
    span = np.diff(at)[:, None]
    rate = np.diff(values, axis=0) / span
    if len(rate) == 1:
        return np.repeat(rate, 2, axis=0)
    before, after = rate[:-1], rate[1:]
    first, second = 2 * span[1:] + span[:-1], span[1:] + 2 * span[:-1]
    same = before * after > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        inner = np.where(same, (first + second) / (first / before + second / after), 0.0)
    return np.concatenate([rate[:1], inner, rate[-1:]])
