"""Policies: what chooses the shots of a frame from the observation.

Every policy answers for one environment (observation [D], an int) and for a batch of them
(observation [N, D], int64 [N]) alike, and starts anew at `reset`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from unwrap.signal import Shots

# Any, because both come in two shapes: of one environment (an int; float32 [D]) and of a batch of N
# (int64 [N]; float32 [N, D], or a dictionary that has it as "state").
Action = Any
Observation = Any


class Policy(ABC):
    """Chooses an action, 0 = 2 DCS, 1 = 4 DCS, 2 = 8 DCS, from what is observed.

    Examples
    --------
    A policy of your own is a class with `act`; `single` makes one code serve one and many:

    >>> class Dim(Policy):
    ...     def act(self, observation, info=None):
    ...         return single(np.where(np.asarray(observation)[..., 0] < 0.1, 2, 0))
    >>> Dim().act(np.array([[0.05], [0.7]]))
    array([2, 0])
    """

    reads_price: ClassVar[bool] = False
    """Whether it acts on the price of power; what does not plays the same at every price."""

    @abstractmethod
    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Action of one environment, or int64 [N] of a batch of N."""

    def act_among(
        self, observation: Observation, info: Mapping[str, Any] | None, allowed: np.ndarray
    ) -> Action:
        """`act`, of the actions `allowed`, bool [3], alone: the next fewer samples in their place.

        The fewest are always allowed.
        """
        lower = np.maximum.accumulate(np.where(allowed, np.arange(len(allowed)), 0))
        return single(lower[self.act(observation, info)])

    def reset(self) -> None:  # noqa: B027 - most policies remember nothing
        """Forget everything: the next `act` is the first of new drives."""


class ScoringPolicy(Policy):
    """Takes the action that it scores highest, the first of equal ones."""

    reads_price = True  # among its features

    @abstractmethod
    def scores(self, observation: Observation) -> np.ndarray:
        """Score of each action, float32 [..., 3], for features [..., D]."""

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The action of the highest score."""
        return single(self.scores(observation).argmax(axis=-1))

    def act_among(
        self, observation: Observation, info: Mapping[str, Any] | None, allowed: np.ndarray
    ) -> Action:
        """The allowed action of the highest score."""
        return single(np.where(allowed, self.scores(observation), -np.inf).argmax(axis=-1))


def checked_shots(shots: int, name: str = "shots") -> Shots:
    """`shots` as `Shots`; `name` is that of the parameter.

    Raises
    ------
    ValueError
        It is not 2, 4 or 8.
    """
    if not isinstance(shots, int | np.integer) or shots not in tuple(Shots):
        raise ValueError(f"{name} is {shots!r}; expected 2, 4 or 8")
    return Shots(shots)


def batch_shape(observation: Observation) -> tuple[int, ...]:
    """() for the observation of one environment, (N,) for a batch of N."""
    features = observation["state"] if isinstance(observation, Mapping) else observation
    return np.shape(features)[:-1]


def same_action(observation: Observation, action: int) -> Action:
    """`action` for the one environment, or for each of the batch, that `observation` is of."""
    return single(np.full(batch_shape(observation), action, dtype=np.int64))


def single(actions: np.ndarray | np.integer) -> Action:
    """Actions [N] as they are; of one environment, [], a Python int."""
    # Not an array of no dimensions: JSON, `is` and list indices of callers want a plain number.
    return int(actions) if np.ndim(actions) == 0 else np.asarray(actions)
