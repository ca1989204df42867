"""Speed of a vehicle over time, and the distance that it has gone by then."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from shotenv.config import HIGHEST_SPEED_M_S

HARDEST_JERK_M_S3 = 6.0
"""No change of speed is more sudden: what passengers call abrupt begins at about 5 [assumed]."""


@dataclass(frozen=True)
class SpeedChange:
    """From the speed before to `speed_m_s`, within `duration_s` from `begin_s` on."""

    begin_s: float
    duration_s: float
    speed_m_s: float

    @property
    def end_s(self) -> float:
        """When the new speed is reached."""
        return self.begin_s + self.duration_s


@dataclass(frozen=True)
class SpeedProfile:
    """Constant speeds with smooth changes in between; the first speed counts before time 0, too.

    In a change from v to w the speed is v + (w - v) (3 u^2 - 2 u^3), u from 0 to 1: acceleration
    starts and ends at 0 and is 1.5 (w - v) / duration at most.

    Attributes
    ----------
    start_m_s : float
        Speed before the first change; negative speeds go backwards.
    changes : tuple of SpeedChange
        In the order of time; none begins before the one before has ended.

    Raises
    ------
    ValueError
        A speed beyond `HIGHEST_SPEED_M_S`, or changes that overlap or take no time.
    """

    start_m_s: float
    changes: tuple[SpeedChange, ...] = ()

    def __post_init__(self) -> None:
        for speed in (self.start_m_s, *(change.speed_m_s for change in self.changes)):
            # Not `abs(speed) > ...`, which is false for NaN.
            if not abs(speed) <= HIGHEST_SPEED_M_S:
                raise ValueError(
                    f"speed_m_s is {speed:g}; expected at most {HIGHEST_SPEED_M_S:g} m/s"
                )
        for change in self.changes:
            if not change.duration_s > 0:
                raise ValueError(f"duration_s is {change.duration_s:g}; expected more than 0")
        for first, second in pairwise(self.changes):
            if second.begin_s < first.end_s:
                raise ValueError(
                    f"begin_s is {second.begin_s:g}; expected at least {first.end_s:g}, where the "
                    "change before ends"
                )

    @property
    def highest_m_s(self) -> float:
        """Highest of the speeds, forwards."""
        return max(self.start_m_s, *(change.speed_m_s for change in self.changes), 0.0)

    def distance_m(self, time_s: float) -> float:
        """Distance since time 0, negative before it for who goes forwards."""
        return self._since_first_m(time_s) - self._at_zero_m

    def speed_m_s(self, time_s: float) -> float:
        """Speed at a time."""
        before, change, share = self._within(time_s)
        return before + (change - before) * share * share * (3.0 - 2.0 * share)

    def acceleration_m_s2(self, time_s: float) -> float:
        """Rate of the speed at a time."""
        before, after, share = self._within(time_s)
        if not 0.0 < share < 1.0:
            return 0.0
        change = self.changes[self._index(time_s)]
        return 6.0 * (after - before) * share * (1.0 - share) / change.duration_s

    def _index(self, time_s: float) -> int:
        """Which change began last; -1 before the first."""
        return bisect_right(self._begins_s, time_s) - 1

    def _within(self, time_s: float) -> tuple[float, float, float]:
        """Speeds before and after the change that began last, and which share of it is over."""
        index = self._index(time_s)
        if index < 0:
            return self.start_m_s, self.start_m_s, 1.0
        change = self.changes[index]
        before = self.changes[index - 1].speed_m_s if index else self.start_m_s
        return before, change.speed_m_s, min(1.0, (time_s - change.begin_s) / change.duration_s)

    def _since_first_m(self, time_s: float) -> float:
        """Distance since the first change began."""
        index = self._index(time_s)
        if index < 0:
            begin = self._begins_s[0] if self.changes else 0.0
            return self.start_m_s * (time_s - begin)
        change, (before, after, u) = self.changes[index], self._within(time_s)
        # The integral of 3 u^2 - 2 u^3 is u^3 - u^4 / 2: half of the change by its end.
        during = change.duration_s * (before * u + (after - before) * (u**3 - u**4 / 2))
        return self._way_m[index] + during + after * max(0.0, time_s - change.end_s)

    @cached_property
    def _begins_s(self) -> list[float]:
        return [change.begin_s for change in self.changes]

    @cached_property
    def _way_m(self) -> list[float]:
        """Distance from the begin of the first change to that of each."""
        way, before = [0.0], self.start_m_s
        for change, following in pairwise(self.changes):
            during = change.duration_s * (before + change.speed_m_s) / 2
            way.append(way[-1] + during + change.speed_m_s * (following.begin_s - change.end_s))
            before = change.speed_m_s
        return way

    @cached_property
    def _at_zero_m(self) -> float:
        return self._since_first_m(0.0)


def change_s(before_m_s: float, after_m_s: float, acceleration_m_s2: float) -> float:
    """Shortest duration of a change of speed, with this acceleration and jerk at its most."""
    step = abs(after_m_s - before_m_s)
    # The second derivative of 3 u^2 - 2 u^3 is 6 at the ends.
    gentle = math.sqrt(6.0 * step / HARDEST_JERK_M_S3)
    return max(1.5 * step / acceleration_m_s2, gentle, 1e-3)


def speeds_in_turn(
    start_m_s: float, holds: Sequence[tuple[float, float, float]], begin_s: float = 0.0
) -> SpeedProfile:
    """Speeds one after the other.

    Parameters
    ----------
    holds : sequence of (acceleration, speed, hold)
        Each speed, m/s, how hard the vehicle changes to it, m/s2, and how long it then keeps it, s.
    begin_s : float
        When the first change begins.
    """
    changes, speed = [], start_m_s
    for acceleration, following, hold_s in holds:
        duration = change_s(speed, following, acceleration)
        changes.append(SpeedChange(begin_s, duration, following))
        begin_s, speed = begin_s + duration + hold_s, following
    return SpeedProfile(start_m_s, tuple(changes))
