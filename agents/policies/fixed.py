"""TODO."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from unwrap.signal import Shots

if TYPE_CHECKING:
    pass
from agents.policies.policy import (
    Action,
    Observation,
    Policy,
    batch_shape,
    checked_shots,
    like,
    single,
)


class FixedPolicy(Policy):
    """Always the same shots.

    Examples
    --------
    >>> FixedPolicy(4).act(np.zeros(3))
    1
    """

    def __init__(self, shots: int) -> None:
        self.action = checked_shots(shots).action

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The same action, whatever is observed."""
        return like(observation, self.action)


class RandomPolicy(Policy):
    """Each action with the same probability."""

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """A fresh draw for each environment."""
        return single(self._generator.integers(len(Shots), size=batch_shape(observation)))

    def reset(self) -> None:
        """Draw the same numbers again."""
        self._generator = np.random.default_rng(self._seed)


class CyclePolicy(Policy):
    """`shots` in every `period`-th frame, starting with the first, and `otherwise` between."""

    def __init__(self, period: int, shots: int = 8, otherwise: int = 2) -> None:
        if period < 2:
            raise ValueError(f"period is {period}; expected at least 2 frames")
        self._period = period
        self._actions = checked_shots(shots).action, checked_shots(otherwise).action
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The action that the frame's place in the cycle asks for."""
        action = self._actions[self._frame % self._period != 0]
        self._frame += 1
        return like(observation, action)

    def reset(self) -> None:
        """Start the cycle at its first frame."""
        self._frame = 0
