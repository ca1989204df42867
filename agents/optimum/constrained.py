"""The optimum under a cap on laser energy: a price per joule at which it spends the cap."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from agents.optimum.dynamic import clairvoyant
from agents.optimum.outcome_table import DriveTable, PlayedTable, play
from agents.optimum.tabulation import Possible

NARROW: Final = 1.02
"""Ratio of two prices between which no more are tried."""
PRICE_SPAN: Final = (1e-3, 1e2)
"""Prices of what 8 DCS spend in a frame, beside an error term of 1: from hardly any to one at which
2 DCS are always best."""
MOST_TRIED: Final = 2 + math.ceil(
    math.log2(math.log(PRICE_SPAN[1] / PRICE_SPAN[0]) / math.log(NARROW))
)
"""Prices that a search may take."""


@dataclass(frozen=True)
class ConstrainedOptimum:
    """Two neighbouring solutions of a Lagrangian, and the shares at which they meet the cap.

    Attributes
    ----------
    prices_per_j : (float, float)
        Of a joule, beside an error term of weight 1; the first spends more than the cap.
    shares : (float, float)
        Of the drives that each of them plays.
    played : (PlayedTable, PlayedTable)
        Costs without the price.
    energy_j : (float, float)
        Mean laser energy per drive of each.
    """

    prices_per_j: tuple[float, float]
    shares: tuple[float, float]
    played: tuple[PlayedTable, PlayedTable]
    energy_j: tuple[float, float]


def constrained_optimum(
    possible: Possible, cap_j: float, *, tick: Callable[[int], object] = lambda tried: None
) -> ConstrainedOptimum:
    """The least cost, power for nothing, of drives that spend `cap_j` of laser energy on average.

    Parameters
    ----------
    possible : Possible
        Drives with a laser that is not derated.
    cap_j : float
        Mean laser energy of a drive, J.
    tick : callable
        Told the number of prices tried after each.

    Notes
    -----
    Exact for a cap on the *mean* over the drives, not on each of them: a solution that costs least
    at a price per joule costs least of all that spend no more than it does (Everett, "Generalized
    Lagrange multiplier method", Oper. Res. 11, 1963), up to the grid of temperatures of dynamic
    programming. Between the energies of two neighbouring prices, at most 2 % apart, the two
    solutions are mixed, some drives as the one and the others as the other, which is no worse than
    the best by more than their costs differ. What costs least is the reward's error (and trips), a
    bounded error, not the mean error in metres.
    """
    free = possible.table(price=0.0)
    energy_j = np.stack([one.laser_energy_j.numpy() for one in possible.outcomes])
    whole_j = float(energy_j[..., -1].mean())
    found: dict[float, tuple[PlayedTable, float]] = {}

    def spent(price: float) -> float:
        if price not in found:
            found[price] = solve(free, energy_j, price / whole_j)
            tick(1)
        return found[price][1]

    near, dear = bracket(spent, cap_j, *PRICE_SPAN)
    (played, more_j), (other, less_j) = found[near], found[dear]
    # Beyond the ends of what any price spends, one solution is all.
    share = float(np.clip((cap_j - less_j) / (more_j - less_j), 0.0, 1.0)) if near < dear else 0.0
    return ConstrainedOptimum(
        (near / whole_j, dear / whole_j), (share, 1.0 - share), (played, other), (more_j, less_j)
    )


def solve(free: DriveTable, energy_j: np.ndarray, price_per_j: float) -> tuple[PlayedTable, float]:
    """What costs least at a price of a joule, its cost without it, and what it spends per drive."""
    best = clairvoyant(priced_per_joule(free, energy_j, price_per_j))
    again = play(free, lambda now: best.actions[:, now.frame])
    return again, float((best.cost - again.cost).mean() / price_per_j)


def priced_per_joule(free: DriveTable, energy_j: np.ndarray, price_per_j: float) -> DriveTable:
    """A table `free` of the price of power, with `energy_j` [N, T, A] at 25 C paid by the joule."""
    return replace(
        free, cost=free.cost + price_per_j * energy_j, laser_cost=price_per_j * energy_j[:, 0]
    )


def bracket(
    spent: Callable[[float], float], cap: float, low: float, high: float
) -> tuple[float, float]:
    """Two prices next to each other, the first of which spends more than `cap`, the other does not.

    Twice the same where there is no such pair: `low` spends no more than the cap, or `high` more.

    Parameters
    ----------
    spent : callable
        From a price to what is spent, about falling.
    low, high : float
        Prices above 0.

    Examples
    --------
    >>> near, dear = bracket(lambda price: 1 / price, 4.0, 0.01, 10.0)
    >>> near < 0.25 <= dear < 1.02 * near
    True
    >>> bracket(lambda price: 1 / price, 1000.0, 0.01, 10.0)
    (0.01, 0.01)
    """
    if spent(low) <= cap:
        return low, low
    if spent(high) > cap:
        return high, high
    while high > NARROW * low:
        middle = float(np.sqrt(low * high))
        if spent(middle) > cap:
            low = middle
        else:
            high = middle
    return low, high
