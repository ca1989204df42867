"""Numbers with their intervals: the jackknife over pixels, and what is drawn from chi-squares."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

Array = np.ndarray
CONFIDENCE = 0.95
"""Of every interval."""
GROUPS = 20
"""Of the jackknife: few enough to be quick, enough that Student's quantile is near the normal's."""
DRAWS = 40_000
"""Of chi-squares: the ends of an interval are within a hundredth of its width."""


@dataclass(frozen=True)
class Estimate:
    """A number and the interval that holds the true one with `CONFIDENCE`."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        digits = significant(self.high - self.low)
        return f"{self.value:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


def significant(width: float) -> int:
    """Decimals that tell an interval of this width with two digits."""
    if not np.isfinite(width) or width <= 0:
        return 6
    return int(np.clip(1 - np.floor(np.log10(width)), 0, 12))


def around(value: float, error: float, freedom: float) -> Estimate:
    """Student's interval of a number with a standard error of so many degrees of freedom."""
    reach = student_quantile(0.5 + CONFIDENCE / 2, freedom) * error
    return Estimate(float(value), float(value - reach), float(value + reach))


def student_quantile(probability: float, freedom: float) -> float:
    """Quantile of Student's distribution: Cornish and Fisher's expansion in 1 / freedom.

    Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 26.7.5. Within 1 % from
    3 degrees of freedom on.

    Examples
    --------
    >>> round(student_quantile(0.975, 19), 3)
    2.093
    """
    z = NormalDist().inv_cdf(probability)
    terms = (
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return z + sum(term / freedom**power for power, term in enumerate(terms, start=1))


def jackknife(numbers: Callable[[Array], Mapping[str, float]], pixels: int) -> dict[str, Estimate]:
    """Every number of a function of pixels, its error by leaving out a twentieth of them in turn.

    Source: Efron and Stein, The Jackknife Estimate of Variance (1981), with groups in place of
    single observations. The groups are interleaved, so that each has pixels of all of the image.
    What several numbers have in common is in all of their intervals.

    Parameters
    ----------
    numbers : callable
        Of the indices of the pixels that it may look at; NaN is what they cannot tell.
    pixels : int
        How many there are.
    """
    index = np.arange(pixels)
    # A stride that shares no factor with the usual widths: a group is no column of the image.
    group = index * 7919 % pixels % GROUPS
    whole = numbers(index)
    without = [numbers(index[group != left]) for left in range(GROUPS)]
    found = {}
    for name, value in whole.items():
        parts = np.array([part[name] for part in without])
        error = np.sqrt((GROUPS - 1) / GROUPS * np.square(parts - parts.mean()).sum())
        if np.isfinite(value) and np.isfinite(error):
            found[name] = around(value, error, GROUPS - 1)
    return found


def pivotal(value: float, draws: Array) -> Estimate:
    """Interval of a number by draws of its generalised pivot (Weerahandi 1993)."""
    low, high = np.quantile(draws, (0.5 - CONFIDENCE / 2, 0.5 + CONFIDENCE / 2))
    return Estimate(float(value), float(low), float(high))


def variance_draws(variance: float, freedom: float, generator: np.random.Generator) -> Array:
    """Variances that may stand behind a measured one: variance freedom / chi-square [DRAWS]."""
    return variance * freedom / generator.chisquare(freedom, DRAWS)
