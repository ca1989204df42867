"""Families of policies of practice: a name, and what is tried when its parameters are tuned."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from agents.policies.bandits import LinUcbPolicy, ThompsonPolicy
from agents.policies.fixed import CyclePolicy, FixedPolicy, MixturePolicy
from agents.policies.looking import LookAndHoldPolicy, LookAndWeighPolicy, PersistencePolicy
from agents.policies.policy import Policy
from agents.policies.rules import SnrThresholdPolicy, SnrTwoThresholdPolicy
from agents.policies.watching import (
    DistanceHysteresisPolicy,
    MotionPolicy,
    UnsurePolicy,
    WakeOnChangePolicy,
)
from unwrap.signal import Shots


class PolicyFamily(NamedTuple):
    """Policies of one kind.

    Attributes
    ----------
    name : str
    candidates : callable
        From the names of the features to the policies that are tried, at most about 40.
    """

    name: str
    candidates: Callable[[Sequence[str]], Iterator[Policy]]


Names = Sequence[str]


def fixed(names: Names) -> Iterator[Policy]:
    """Always the same shots."""
    return (FixedPolicy(shots) for shots in Shots)


def cycle(names: Names) -> Iterator[Policy]:
    """More shots every n-th frame, or fewer."""
    for period, (shots, otherwise) in product((2, 3, 4, 6, 8, 16), ((8, 2), (8, 4), (4, 2))):
        yield CyclePolicy(period, shots=shots, otherwise=otherwise)
    # The other way round: 2 or 4 DCS now and then, and 8 between.
    for period, shots in product((3, 4, 8), (2, 4)):
        yield CyclePolicy(period, shots=shots, otherwise=8)


def mixture(names: Names) -> Iterator[Policy]:
    """Shares in steps of a quarter."""
    quarters = np.arange(5) / 4
    for two, four in product(quarters, quarters):
        if two + four <= 1:
            yield MixturePolicy((two, four, 1 - two - four))


def snr_threshold(names: Names) -> Iterator[Policy]:
    """Either side of a threshold on signal-to-noise."""
    pairs = ((8, 2), (2, 8), (8, 4), (4, 8))
    for (below, above), threshold in product(pairs, (0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.8)):
        yield SnrThresholdPolicy(names, threshold, below=below, above=above)


def snr_two_thresholds(names: Names) -> Iterator[Policy]:
    """Three bands of signal-to-noise."""
    limits = (0.2, 0.26, 0.33, 0.43, 0.6)
    for shots, low, high in product(((8, 4, 2), (2, 4, 8), (2, 8, 2), (4, 8, 2)), limits, limits):
        if low < high:
            yield SnrTwoThresholdPolicy(names, low, high, *shots)


def distance_hysteresis(names: Names) -> Iterator[Policy]:
    """Modes by the network's distance, in both directions."""
    gaps = ((0.2, 0.3), (0.3, 0.4), (0.4, 0.5), (0.5, 0.6), (0.6, 0.65), (0.65, 0.7))
    for (near, far), (few, more) in product(gaps, ((2, 8), (8, 2), (4, 8), (8, 4))):
        yield DistanceHysteresisPolicy(names, near, far, few, more)


def wake_on_change(names: Names) -> Iterator[Policy]:
    """Awake while the gray image changes."""
    for change, still, asleep in product((0.01, 0.03, 0.05, 0.1, 0.3), (1, 2, 4, 8), (2, 4)):
        yield WakeOnChangePolicy(names, change, still, asleep)


def motion(names: Names) -> Iterator[Policy]:
    """8 DCS where motion leaves the last ones behind."""
    for way, change, otherwise in product((1.0, 3.0, 10.0, 30.0), (0.05, 0.1, 0.2, 0.5), (2, 4)):
        yield MotionPolicy(names, way, 0.2, change, otherwise)


def unsure(names: Names) -> Iterator[Policy]:
    """8 DCS where there is doubt."""
    limits = (0.02, 0.03, 0.04, 0.05, 0.07, 0.1)
    for confidence, disagreement, otherwise in product((0.0, 0.52, 0.54), limits, (2, 4)):
        yield UnsurePolicy(names, confidence, disagreement, otherwise)


LIMITS: Final = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)


def persistence(names: Names) -> Iterator[Policy]:
    """What the last look found, however the scene changed."""
    for limit, period in product(LIMITS, (4, 8, 12, 16, 24)):
        yield PersistencePolicy(names, limit, period)


def look_and_hold(names: Names) -> Iterator[Policy]:
    """Looks after a change, then what was good enough."""
    for limit, period, amplitude in product(LIMITS, (12, 24), (0.1, 0.3)):
        yield LookAndHoldPolicy(names, limit, period, 0.3, amplitude)


def look_and_weigh(names: Names) -> Iterator[Policy]:
    """Looks after a change, then what regret and price weigh least."""
    for period, amplitude, gain in product((24, 48), (0.1, 0.3), (0.6, 1.0)):
        yield LookAndWeighPolicy(names, period, 0.3, amplitude, gain=gain)


def look_and_weigh_heat(names: Names) -> Iterator[Policy]:
    """The same with a price on heat."""
    for amplitude, heat, near_k in product((0.1, 0.3), (0.05, 0.2), (0.5, 2.0)):
        yield LookAndWeighPolicy(names, 24, 0.3, amplitude, heat_price=heat, near_k=near_k)


def lin_ucb(names: Names) -> Iterator[Policy]:
    """Confidence bounds of regrets."""
    for width, forget in product((0.02, 0.06, 0.2), (0.95, 1.0)):
        yield LinUcbPolicy(names, width, ridge=0.1, forget=forget)


def thompson(names: Names) -> Iterator[Policy]:
    """Draws of regrets."""
    for width, forget in product((0.02, 0.06, 0.2), (0.95, 1.0)):
        yield ThompsonPolicy(names, width, ridge=0.1, forget=forget)


FAMILIES_OF_PRACTICE: Final = tuple(
    PolicyFamily(function.__name__, function)
    for function in (
        fixed,
        cycle,
        mixture,
        snr_threshold,
        snr_two_thresholds,
        persistence,
        distance_hysteresis,
        wake_on_change,
        unsure,
        motion,
        look_and_hold,
        look_and_weigh,
        look_and_weigh_heat,
        lin_ucb,
        thompson,
    )
)
"""What a scheduler has to beat."""
