"""One tuner for all families of policies: at each price the candidate with the best return.

What does not read the price plays the same at each, and is played once: its return at another price
follows from what each frame's power was. What reads it is played at each price.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from gymnasium.vector import VectorEnv

from agents.evaluation.play import PlayedDrives, play_drives
from agents.policies import Policy, PolicyFamily
from shotenv.decision import FEATURE_NAMES
from unwrap.support import progress

PlayAt = Callable[[Policy, float | None], PlayedDrives]
"""Drives of a policy at a price; at None, which suffices for one that does not read it, at any."""


@dataclass(frozen=True)
class Tuned:
    """The best of a family at one price.

    Attributes
    ----------
    price : float
        Weight of power in the reward.
    policy : Policy
    mean_return : float
        Over the drives that chose it, which favours it: judge it on others.
    """

    price: float
    policy: Policy
    mean_return: float


def best_at_prices(
    candidates: Iterable[Policy], prices: Sequence[float], play_at: PlayAt
) -> list[Tuned]:
    """The candidate with the best mean return at each of the `prices`; of equal ones the first.

    Raises
    ------
    ValueError
        There is no candidate.
    """
    policies = list(candidates)
    if not policies:
        raise ValueError("candidates is empty; expected at least one policy")
    returns = np.empty((len(policies), len(prices)))
    for row, policy in enumerate(policies):
        once = None if policy.reads_price else play_at(policy, None)
        for column, price in enumerate(prices):
            played = once or play_at(policy, price)
            returns[row, column] = played.returns_at(price).mean()
    best = returns.argmax(axis=0)
    return [
        Tuned(price, policies[row], float(returns[row, column]))
        for column, (price, row) in enumerate(zip(prices, best, strict=True))
    ]


def tune(
    families: Sequence[PolicyFamily], envs: VectorEnv, seeds: Sequence[int], prices: Sequence[float]
) -> dict[str, list[Tuned]]:
    """The best of each family at each price, tuned on the drives `seeds` of `envs`.

    Parameters
    ----------
    envs : gymnasium.vector.VectorEnv
        As many environments as `seeds`, of validation drives; one that remembers what it measured
        is many times as fast.
    """
    plans = {family.name: list(family.candidates(FEATURE_NAMES)) for family in families}
    plays = sum(len(prices) if p.reads_price else 1 for plan in plans.values() for p in plan)
    with progress(plays, "tuning on validation drives", "play") as bar:

        def play_at(policy: Policy, price: float | None) -> PlayedDrives:
            played = play_drives(policy, envs, seeds, price=price)
            bar.update(1)
            return played

        return {name: best_at_prices(plan, prices, play_at) for name, plan in plans.items()}
