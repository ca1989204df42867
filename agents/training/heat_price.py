"""A price on heat: close to the trip, power is worth more than its price says.

What a frame takes from later ones by its heat comes a minute later, far beyond the frames that a
regression looks ahead. The last kelvins before the trip are what is short then, and what is short
has a price (the shadow price of a constraint: Boyd and Vandenberghe, Convex Optimization, 5.6).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from shotenv.decision import FEATURE_NAMES, State, feature_index, heat_margin_k

MARGIN = feature_index(FEATURE_NAMES, "heat_margin")


def least_price(margin_k: np.ndarray, *, heat_price: float, near_k: float) -> np.ndarray:
    """Least price of power in frames that begin at a margin to the trip, K.

    `heat_price` at the trip and while the laser is off, falling linearly to 0 at `near_k`.

    Examples
    --------
    >>> least_price(np.array([3.0, 1.0, 0.0, -5.0]), heat_price=0.2, near_k=2.0)
    array([0. , 0.1, 0.2, 0.2])
    """
    return heat_price * np.clip(1.0 - margin_k / near_k, 0.0, 1.0)


def with_heat_price(
    state: State, observation: np.ndarray, *, heat_price: float, near_k: float
) -> State:
    """The state [N], observed as [N, D], with power at its price or the least one of its margin."""
    margin_k = heat_margin_k(observation[:, MARGIN].astype(np.float64))
    least = torch.from_numpy(least_price(margin_k, heat_price=heat_price, near_k=near_k))
    price = torch.maximum(state.drive.power_price, least)
    return replace(state, drive=replace(state.drive, power_price=price))
