"""One tuner for all families of policies: at each price the candidate with the best return.

What does not read the price plays the same at each, and is played once: its return at another price
follows from what each frame's power was. What reads it is played at each price. Candidates are
played side by side in one batch, since a step of many drives takes hardly longer than one of few.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium.vector import VectorEnv

from agents.evaluation.play import make_envs, play_drives
from agents.policies import Action, FixedPolicy, Observation, Policy, PolicyFamily
from shotenv.config import EnvConfig
from shotenv.decision import FEATURE_NAMES
from shotenv.env import ShotScheduleVectorEnv
from unwrap.signal import Shots
from unwrap.support import progress

AT_A_TIME: Final = 12
"""Candidates that are played side by side: 12 with 12 drives each take 1.5 times as long as one."""


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


def tuning_envs(config: EnvConfig, drives: int) -> ShotScheduleVectorEnv:
    """Environments in which `tune` plays `AT_A_TIME` candidates on each of `drives` validation
    drives."""
    return make_envs(config, "validation", AT_A_TIME * drives, "Disabled")


def tune(
    families: Sequence[PolicyFamily], envs: VectorEnv, seeds: Sequence[int], prices: Sequence[float]
) -> dict[str, list[Tuned]]:
    """The best of each family at each price, tuned on the drives `seeds` of `envs`.

    Parameters
    ----------
    envs : gymnasium.vector.VectorEnv
        Those of `tuning_envs`; or as many environments as `seeds`, or several times as many, of
        validation drives.

    Raises
    ------
    ValueError
        There is no price, a family has no candidate, or `envs` are not a multiple of `seeds`.
    """
    if not prices:
        raise ValueError("prices is empty; expected at least one weight of power")
    plans = {family.name: list(family.candidates(FEATURE_NAMES)) for family in families}
    for name, plan in plans.items():
        if not plan:
            raise ValueError(f"candidates of family {name!r} are none; expected at least one")
    plays = sum(len(prices) if p.reads_price else 1 for plan in plans.values() for p in plan)
    with progress(plays, "tuning on validation drives", "play") as bar:
        return {
            name: best_at_prices(plan, mean_returns(plan, envs, seeds, prices, bar.update), prices)
            for name, plan in plans.items()
        }


def best_at_prices(
    candidates: Sequence[Policy], returns: np.ndarray, prices: Sequence[float]
) -> list[Tuned]:
    """The candidate with the best of the `returns` [K, P] at each price; of equal ones the first.

    Examples
    --------
    >>> few, many = FixedPolicy(2), FixedPolicy(8)
    >>> best = best_at_prices([few, many], np.array([[1.0, 5.0], [3.0, 2.0]]), (0.1, 0.4))
    >>> [(tuned.policy is few, tuned.mean_return) for tuned in best]
    [(False, 3.0), (True, 5.0)]
    """
    rows = returns.argmax(axis=0)
    return [
        Tuned(price, candidates[row], float(returns[row, column]))
        for column, (price, row) in enumerate(zip(prices, rows, strict=True))
    ]


def mean_returns(
    policies: Sequence[Policy],
    envs: VectorEnv,
    seeds: Sequence[int],
    prices: Sequence[float],
    tick: Callable[[int], object] = lambda plays: None,
) -> np.ndarray:
    """Mean return of each of the policies at each of the prices, over the same drives, [K, P].

    Parameters
    ----------
    envs, seeds
        As for `tune`.
    tick : callable
        Told the number of plays that were done.
    """
    at_a_time, rest = divmod(envs.num_envs, max(len(seeds), 1))
    if rest or not at_a_time or not seeds:
        raise ValueError(f"envs are {envs.num_envs}; expected a multiple of the {len(seeds)} seeds")
    returns = np.empty((len(policies), len(prices)))
    # What reads the price is apart, for it alone is played at each of them.
    for reads in (False, True):
        alike = [row for row, policy in enumerate(policies) if policy.reads_price is reads]
        for start in range(0, len(alike), at_a_time):
            rows = alike[start : start + at_a_time]
            side = SideBySide([policies[row] for row in rows], at_a_time)
            for column, price in enumerate(prices):
                if reads or column == 0:
                    played = play_drives(side, envs, [*seeds] * at_a_time, price=price)
                    tick(len(rows))
                means = played.returns_at(price).reshape(at_a_time, -1).mean(axis=1)
                returns[rows, column] = means[: len(rows)]
    return returns


class SideBySide(Policy):
    """Plays each of some policies on an equal part of a batch of environments.

    Parameters
    ----------
    policies : sequence of Policy
        They see the observation of their own part alone, and no `info`.
    parts : int
        Into which the batch is split; those beyond the number of policies take 2 DCS.

    Examples
    --------
    >>> SideBySide([FixedPolicy(8), FixedPolicy(4)], 3).act(np.zeros((6, 1)))
    array([2, 2, 1, 1, 0, 0])
    """

    def __init__(self, policies: Sequence[Policy], parts: int) -> None:
        self._policies = [*policies, *[FixedPolicy(Shots.TWO)] * (parts - len(policies))]

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Actions of all parts, int64 [N], for the observation [N, D] of a batch."""
        parts = np.split(observation, len(self._policies))
        pairs = zip(self._policies, parts, strict=True)
        return np.concatenate([policy.act(part) for policy, part in pairs])

    def reset(self) -> None:
        """Reset each policy."""
        for policy in self._policies:
            policy.reset()
