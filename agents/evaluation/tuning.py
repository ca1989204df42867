"""One tuner for all families of policies: at each price the candidate with the best return.

What does not read the price plays the same at each, and is played once: its return at another price
follows from what each frame's power was. What reads it is played at each price. Candidates are
played side by side in one batch, since a step of many drives takes hardly longer than one of few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium.vector import VectorEnv

from agents.evaluation.play import make_envs, play_drives
from agents.policies import Action, FixedPolicy, Observation, Policy, PolicyFamily
from shotenv.config import EnvConfig
from shotenv.decision import FEATURE_NAMES, Problem
from shotenv.env import ShotScheduleVectorEnv, check_options
from unwrap.signal import Shots
from unwrap.support import progress

AT_A_TIME: Final = 12
"""Candidates that are played side by side: 12 with 12 drives each take 1.5 times as long as one."""
MOST_DRIVES: Final = 10_000
"""Most drives that are held in memory at once, for each of those candidates."""


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
    drives.

    Raises
    ------
    TypeError, ValueError
        `config` is no `EnvConfig`, or `drives` no number of drives.
    """
    if not isinstance(config, EnvConfig):
        raise TypeError(f"config is {type(config).__name__}; expected an EnvConfig")
    if not isinstance(drives, int) or not 0 < drives <= MOST_DRIVES:
        raise ValueError(f"drives is {drives!r}; expected a whole number of 1 to {MOST_DRIVES}")
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
    TypeError, ValueError
        There is no price, or one that cannot be set; a family has no candidate; `envs` are not a
        multiple of `seeds`; or an argument is of another kind. The message names it.
    """
    _check_arguments(families, envs, seeds, prices)
    plans = {family.name: _candidates(family) for family in families}
    plays = sum(len(prices) if p.reads_price else 1 for plan in plans.values() for p in plan)
    with progress(plays, "tuning on validation drives", "play") as bar:
        return {
            name: best_at_prices(plan, mean_returns(plan, envs, seeds, prices, bar.update), prices)
            for name, plan in plans.items()
        }


def _candidates(family: PolicyFamily) -> list[Policy]:
    """What is tried of a family; ValueError where it is nothing, or no policies."""
    made: Any = family.candidates(FEATURE_NAMES)
    plan = list(made) if isinstance(made, Iterable) else []
    if not plan or not all(isinstance(policy, Policy) for policy in plan):
        raise ValueError(
            f"candidates of family {family.name!r} are {plan or 'none'}; expected policies, at "
            "least one"
        )
    return plan


def _check_arguments(families: Any, envs: Any, seeds: Any, prices: Any) -> None:
    """Refuse arguments of `tune` by name."""
    listed = {"families": families, "seeds": seeds, "prices": prices}
    for name, value in listed.items():
        if not isinstance(value, list | tuple | np.ndarray) or np.ndim(value) == 0:
            raise TypeError(f"{name} is {type(value).__name__}; expected a list or tuple")
    if not len(prices):
        raise ValueError("prices is empty; expected at least one weight of power")
    for family in families:
        if not isinstance(family, PolicyFamily):
            raise TypeError(f"families holds {type(family).__name__}; expected PolicyFamily")
    problem = getattr(getattr(envs, "unwrapped", None), "problem", None)
    if not isinstance(envs, VectorEnv) or not isinstance(problem, Problem):
        raise TypeError(f"envs is {type(envs).__name__}; expected that of `tuning_envs`")
    for name, option, values in (("seeds", "drive", seeds), ("prices", "power_price", prices)):
        for value in values:
            try:
                check_options({option: value}, problem)
            except ValueError as error:
                raise ValueError(f"{name}: {error}") from None


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
