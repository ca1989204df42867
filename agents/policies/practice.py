"""Families of policies of practice: a name, and what is tried when its parameters are tuned.

Values were spread until, on validation drives of the default at prices of .01 to .35, the best lay
within them, or at a natural end: at one a rule is a fixed choice, or looks at nothing any more.
"""

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
        From the names of the features to the policies that are tried, at most about 90.
    """

    name: str
    candidates: Callable[[Sequence[str]], Iterator[Policy]]


Names = Sequence[str]
NEVER: Final = np.inf
"""Limit of a change beyond which none goes."""


def fixed(names: Names) -> Iterator[Policy]:
    """Always the same shots."""
    return (FixedPolicy(shots) for shots in Shots)


def cycle(names: Names) -> Iterator[Policy]:
    """Other shots in every n-th frame."""
    pairs = ((8, 2), (8, 4), (4, 2), (2, 4), (4, 8), (2, 8))
    for period, (shots, otherwise) in product((2, 3, 4, 8, 16, 64, 256), pairs):
        yield CyclePolicy(period, shots=shots, otherwise=otherwise)


def mixture(names: Names) -> Iterator[Policy]:
    """Shares in steps of an eighth."""
    eighths = np.arange(9) / 8
    for two, four in product(eighths, eighths):
        if two + four <= 1:
            yield MixturePolicy((two, four, 1 - two - four))


def snr_threshold(names: Names) -> Iterator[Policy]:
    """Either side of a threshold on signal-to-noise."""
    thresholds = (0.0, 0.2, 0.21, 0.22, 0.23, 0.24, 0.26, 0.3, 0.4, 0.6, 0.8, 1.0)
    pairs = ((8, 2), (8, 4), (4, 2), (4, 8), (2, 8))
    for (below, above), threshold in product(pairs, thresholds):
        yield SnrThresholdPolicy(names, threshold, below=below, above=above)


def snr_two_thresholds(names: Names) -> Iterator[Policy]:
    """Three bands of signal-to-noise."""
    limits = (0.2, 0.22, 0.24, 0.3, 0.8, 0.9)
    for shots, low, high in product(((8, 4, 2), (8, 2, 8), (2, 8, 2), (4, 8, 2)), limits, limits):
        if low < high:
            yield SnrTwoThresholdPolicy(names, low, high, *shots)


def distance_hysteresis(names: Names) -> Iterator[Policy]:
    """Modes by the network's distance, with gaps of several widths."""
    limits = (0.2, 0.25, 0.3, 0.35, 0.5, 0.6, 0.65, 0.7, 0.75)
    for near, gap, (few, more) in product(limits, (0.0, 0.05, 0.1), ((2, 8), (4, 8))):
        yield DistanceHysteresisPolicy(names, near, near + gap, few, more)


def wake_on_change(names: Names) -> Iterator[Policy]:
    """Awake while the gray image changes."""
    changes = (0.0, 0.05, 0.1, 0.2, 0.4, NEVER)
    for change, still, asleep in product(changes, (1, 4, 16, 32, 64), (2, 4)):
        yield WakeOnChangePolicy(names, change, still, asleep)


def motion(names: Names) -> Iterator[Policy]:
    """8 DCS where motion leaves the last ones behind."""
    ways, turns, changes = (0.0, 3.0, 30.0, NEVER), (0.2, NEVER), (0.0, 0.1, 0.4, NEVER)
    for way, turn, change, otherwise in product(ways, turns, changes, (2, 4)):
        yield MotionPolicy(names, way, turn, change, otherwise)


def unsure(names: Names) -> Iterator[Policy]:
    """8 DCS where there is doubt."""
    confidences = (0.0, 0.52, 0.53, 0.54, 0.55, 0.57, 0.6)
    disagreements = (0.03, 0.04, 0.05, 0.07, NEVER)
    for confidence, disagreement, otherwise in product(confidences, disagreements, (2, 4)):
        yield UnsurePolicy(names, confidence, disagreement, otherwise)


def persistence(names: Names) -> Iterator[Policy]:
    """What the last look found, however the scene changed."""
    limits = (0.01, 0.03, 0.05, 0.1, 0.15, 0.2, 0.3)
    for limit, period in product(limits, (2, 3, 6, 12, 24, 48, 96, 256)):
        yield PersistencePolicy(names, limit, period)


CHANGES: Final = (
    (0.15, 0.1, 0),
    (0.15, 0.1, 1),
    (0.4, 0.2, 1),
    (1.2, NEVER, 0),
    (NEVER, NEVER, 0),
)
"""Change of the gray image and of amplitude after which one looks, from a slight one to none, and
the frame from which the amplitude is measured."""


def look_and_hold(names: Names) -> Iterator[Policy]:
    """Looks after a change, then what was good enough."""
    limits = (0.02, 0.03, 0.05, 0.1, 0.2, 0.4)
    for limit, period, change in product(limits, (12, 24, 256), CHANGES):
        yield LookAndHoldPolicy(names, limit, period, *change)


def look_and_weigh(names: Names) -> Iterator[Policy]:
    """Looks after a change, then what regret and price weigh least."""
    for period, change, gain in product((12, 24, 256), CHANGES, (0.2, 0.3, 0.45, 0.6, 0.9)):
        yield LookAndWeighPolicy(names, period, *change, gain=gain)


def look_and_weigh_heat(names: Names) -> Iterator[Policy]:
    """The same with a price on heat."""
    prices = ((0.02, 8.0), (0.05, 2.0), (0.15, 0.5))
    for period, change, gain, (heat, near_k) in product((24, 256), CHANGES, (0.45, 0.6), prices):
        yield LookAndWeighPolicy(names, period, *change, gain=gain, heat_price=heat, near_k=near_k)


WIDTHS, RIDGES, FORGETS = (0.0, 0.03, 0.1, 0.3), (3.0, 10.0, 30.0), (0.4, 0.6, 0.8, 0.97)


def lin_ucb(names: Names) -> Iterator[Policy]:
    """Confidence bounds of regrets."""
    for width, ridge, forget in product(WIDTHS, RIDGES, FORGETS):
        yield LinUcbPolicy(names, width, ridge, forget)


def thompson(names: Names) -> Iterator[Policy]:
    """Draws of regrets."""
    for width, ridge, forget in product(WIDTHS, RIDGES, FORGETS):
        yield ThompsonPolicy(names, width, ridge, forget)


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
