"""What an exported scheduler is checked against: torch's own scores and actions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from agents.policies import NetworkPolicy
from unwrap.signal import Shots

LIMIT: Final = 2.0
"""Features lie within +-LIMIT, as the environment clips them."""
ROUNDING: Final = 1e-4
"""Difference of scores, beside the frame's largest, below which their order is rounding's
(assumed; the sums of some hundred products in float32 differ by about 1e-6)."""


@dataclass(frozen=True)
class CheckCases:
    """Observations, allowed actions, and what torch makes of them.

    Attributes
    ----------
    observations : float32 [N, D]
    allowed : bool [N, 3]
        Fewest samples always are, as in `action_masks` of the environment.
    scores : float32 [N, 3]
    actions : int64 [N]
    """

    observations: np.ndarray
    allowed: np.ndarray
    scores: np.ndarray
    actions: np.ndarray


def cases_of(policy: NetworkPolicy, observations: np.ndarray, seed: int = 0) -> CheckCases:
    """Cases of `observations` [N, D] with allowed actions drawn at random."""
    shape = len(observations), len(Shots)
    # Half of them allow everything: that is what a cool laser does.
    allowed = np.random.default_rng(seed).random(shape) < 0.7
    allowed[:, 0] = True
    allowed[::2] = True
    scores = policy.scores(observations)
    return CheckCases(observations, allowed, scores, best_allowed(scores, allowed))


def random_cases(policy: NetworkPolicy, count: int, seed: int = 0) -> CheckCases:
    """`count` cases of random features within their limits."""
    shape = count, len(policy.feature_names)
    drawn = np.random.default_rng(seed).normal(size=shape).astype(np.float32)
    return cases_of(policy, drawn.clip(-LIMIT, LIMIT), seed)


def best_allowed(scores: np.ndarray, allowed: np.ndarray) -> np.ndarray:
    """Action of the highest score among the allowed ones, the first of equals, int64 [N]."""
    return np.where(allowed, scores, -np.inf).argmax(axis=1)


def different_actions(cases: CheckCases, actions: np.ndarray) -> int:
    """How many of `actions` [N] are not torch's, though no rounding explains it."""
    ranked = np.sort(np.where(cases.allowed, cases.scores, -np.inf), axis=1)
    lead = ranked[:, -1] - ranked[:, -2]
    clear = lead > ROUNDING * np.abs(cases.scores).max(axis=1).clip(min=1.0)
    return int(((actions != cases.actions) & clear).sum())


def require_same_actions(maker: str, cases: CheckCases, actions: np.ndarray) -> None:
    """Raise ValueError where `maker` chooses otherwise than torch."""
    if different := different_actions(cases, actions):
        raise ValueError(
            f"{maker} and torch choose differently in {different} of {len(actions)} observations; "
            "expected none; nothing was written"
        )
