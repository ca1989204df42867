"""Policies that look at nothing: always the same shots, in turn, or drawn at random."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from agents.policies.policy import (
    Action,
    Observation,
    Policy,
    batch_shape,
    checked_shots,
    same_action,
    single,
)
from agents.policies.readings import checked_frames, checked_seed, three_numbers
from unwrap.signal import Shots


class FixedPolicy(Policy):
    """Always the same shots, as cameras are set up today.

    Examples
    --------
    >>> FixedPolicy(4).act(np.zeros(3))
    1
    """

    def __init__(self, shots: int) -> None:
        self.action = checked_shots(shots).action

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The same action, whatever is observed."""
        return same_action(observation, self.action)

    def __str__(self) -> str:
        """The rule in words."""
        return f"always {tuple(Shots)[self.action]:d} DCS"


class RandomPolicy(Policy):
    """Each action with the same probability."""

    def __init__(self, seed: int = 0) -> None:
        self._seed = checked_seed(seed)
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """A fresh draw for each environment."""
        return single(self._generator.integers(len(Shots), size=batch_shape(observation)))

    def reset(self) -> None:
        """Draw the same numbers again."""
        self._generator = np.random.default_rng(self._seed)

    def __str__(self) -> str:
        return f"random, seed {self._seed}"


class MixturePolicy(Policy):
    """Each action with a probability of its own, whatever is observed.

    What is best under a bound on mean energy may have to be mixed: Beutler and Ross, "Optimal
    policies for controlled Markov chains with a constraint", J. Math. Anal. Appl. 112 (1985).

    Parameters
    ----------
    probabilities : sequence of 3 floats
        Of 2, 4 and 8 DCS.
    seed : int
        Of the draws.
    """

    def __init__(self, probabilities: Sequence[float], seed: int = 0) -> None:
        shares = three_numbers(probabilities)
        if not ((shares >= 0).all() and abs(shares.sum() - 1.0) <= 1e-9):
            raise ValueError(
                f"probabilities is {probabilities!r}; expected three numbers >= 0 that add up to 1"
            )
        self._shares = shares
        self._seed = checked_seed(seed)
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """A fresh draw for each environment."""
        shape = batch_shape(observation)
        return single(self._generator.choice(len(Shots), size=shape, p=self._shares))

    def reset(self) -> None:
        """Draw the same numbers again."""
        self._generator = np.random.default_rng(self._seed)

    def __str__(self) -> str:
        """The mixture in words."""
        shares = zip(self._shares, Shots, strict=True)
        parts = [f"{share:.0%} {shots:d} DCS" for share, shots in shares]
        return f"at random {', '.join(parts)}"


class CyclePolicy(Policy):
    """`shots` in every `period`-th frame, starting with the first, and `otherwise` between.

    As the patent US 10,607,352 has key frames of several modulation frequencies, and between them
    frames of one.

    Examples
    --------
    >>> print(CyclePolicy(4, shots=8, otherwise=2))
    8 DCS every 4th frame, else 2
    """

    def __init__(self, period: int, shots: int = 8, otherwise: int = 2) -> None:
        self._period = checked_frames("period", period, 2)
        self._shots, self._otherwise = checked_shots(shots), checked_shots(otherwise, "otherwise")
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The action that the frame's place in the cycle asks for."""
        special = self._frame % self._period == 0
        self._frame += 1
        return same_action(observation, (self._shots if special else self._otherwise).action)

    def reset(self) -> None:
        """Start the cycle at its first frame."""
        self._frame = 0

    def __str__(self) -> str:
        """The rule in words."""
        # 11th, 12th and 13th, though 1st, 2nd and 3rd; so, too, 111th.
        teens = 10 < self._period % 100 < 20
        ending = "th" if teens else {1: "st", 2: "nd", 3: "rd"}.get(self._period % 10, "th")
        return f"{self._shots} DCS every {self._period}{ending} frame, else {self._otherwise}"
