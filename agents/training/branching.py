"""Drives that can be played on from any frame with any action, at next to no cost.

What a frame brings depends on the drive, the frame and the action alone. So all of it is measured
once; then the transition is played with what is known, half a million frames a second on one core:
enough to follow every action of every frame for some frames, with the very noise that the others
meet, instead of guessing from one played path what the other actions would have led to.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from agents.optimum import Possible, tabulate
from agents.policies import Policy
from shotenv.decision import (
    FEATURE_NAMES,
    Drive,
    Measurement,
    Problem,
    State,
    measure_frames,
    no_depth,
    observe,
    reset,
    step,
)
from unwrap.signal import Shots
from unwrap.support import concatenate, mapped, take

CHUNK = 4096
"""Most states that are followed at once: more would fall out of the processor's caches."""


class Known:
    """`measure_frames` of the drives of `possible`, looked up: the same numbers."""

    def __init__(self, possible: Possible) -> None:
        outcomes = possible.outcomes
        # [N, T, 3] and [N, T, 3, S].
        self._scores = mapped(lambda *each: torch.stack(each), *(one.score for one in outcomes))
        self._features = torch.stack([one.features for one in outcomes])
        self._error_of_four = torch.stack([one.reference["error"] for one in outcomes])
        seeds = torch.cat([drive.seed for drive in possible.drives])
        self._sorted, self._order = seeds.sort()

    def __call__(
        self,
        problem: Problem,
        drive: Drive,
        step: Tensor,
        shots: Tensor,
        power_w: Tensor | None = None,
    ) -> Measurement:
        """As `measure_frames`; a derated laser is measured."""
        if power_w is not None and drive.is_derated(power_w):
            return measure_frames(problem, drive, step, shots, power_w)
        row = self._order[torch.searchsorted(self._sorted, drive.seed)]
        # 2, 4, 8 are actions 0, 1, 2; a laser that is off takes none, whatever stands there.
        action = shots.clamp(min=Shots.TWO) // Shots.FOUR
        score = mapped(lambda values: values[row, step, action], self._scores)
        if not shots.all():
            lost = no_depth(len(step), problem.config.sensor.max_range_m)
            score = mapped(lambda one, other: torch.where(shots > 0, one, other), score, lost)
        return Measurement(score, self._error_of_four[row, step], self._features[row, step, action])


@dataclass(frozen=True)
class Path:
    """Drives as they were played: N drives, T frames.

    Attributes
    ----------
    states : list of State
        Before each frame, batches of N.
    observations : float32 [T, N, D]
    returns : float64 [N]
    """

    states: list[State]
    observations: np.ndarray
    returns: np.ndarray


class Branches:
    """The drives that environments of `problem` have with `seeds`.

    Parameters
    ----------
    tick : callable
        Told the number of frames after each drive has been measured.
    """

    def __init__(
        self,
        problem: Problem,
        seeds: Sequence[int],
        *,
        tick: Callable[[int], object] = lambda frames: None,
    ) -> None:
        possible = tabulate(problem, seeds, tick=tick)
        self.problem = problem
        self.feature_names = FEATURE_NAMES
        self._measure = Known(possible)
        self._start = reset(problem, [int(drive.seed) for drive in possible.drives])

    def __len__(self) -> int:
        """Number of drives."""
        return len(self._start.step)

    def play(self, policy: Policy, prices: np.ndarray) -> Path:
        """Play all drives with power at `prices` [N]."""
        power_price = torch.as_tensor(prices, dtype=torch.float64)
        state = replace(self._start, drive=replace(self._start.drive, power_price=power_price))
        states, seen, returns = [], [], np.zeros(len(self))
        policy.reset()
        for _ in range(self.problem.config.frames_per_drive):
            states.append(state)
            seen.append(observe(self.problem, state).numpy())
            actions = torch.as_tensor(policy.act(seen[-1]))
            state, outcome = step(self.problem, state, actions, measure=self._measure)
            returns += outcome.reward.numpy()
        return Path(states, np.stack(seen), returns)

    def mean_return(self, policy: Policy, prices: Sequence[float]) -> float:
        """Mean return of all drives at each of the `prices`."""
        played = [self.play(policy, np.full(len(self), price)) for price in prices]
        return float(np.mean([one.returns for one in played]))

    def follow(
        self, states: Sequence[State], policy: Policy, *, horizon: int, gamma: float
    ) -> np.ndarray:
        """Discounted rewards of each action and of what `policy` does after it, float64 [S, N, 3].

        Parameters
        ----------
        states : sequence of S State
            Batches of N.
        policy : Policy
            Without memory of its own: it is asked about states as they come.
        horizon : int
            Frames that are played, that of the action among them; fewer where the drive ends.
        gamma : float
            Discount per frame.
        """
        at_once = max(1, CHUNK // (3 * len(self)))
        parts = [
            self._followed(concatenate(states[begin : begin + at_once]), policy, horizon, gamma)
            for begin in range(0, len(states), at_once)
        ]
        return np.concatenate(parts).reshape(len(states), len(self), len(Shots))

    def _followed(self, start: State, policy: Policy, horizon: int, gamma: float) -> np.ndarray:
        count, frames = len(start.step), self.problem.config.frames_per_drive
        state = take(start, torch.arange(count).repeat_interleave(len(Shots)))
        actions = torch.arange(len(Shots)).repeat(count)
        found = torch.zeros(len(actions), dtype=torch.float64)
        rows = torch.arange(len(actions))
        for ahead in range(horizon):
            if ahead:
                # Drives that are over have nothing more to bring.
                going = (state.step < frames).nonzero().squeeze(1)
                if not len(going):
                    break
                if len(going) < len(rows):
                    state, rows = take(state, going), rows[going]
                actions = torch.as_tensor(policy.act(observe(self.problem, state).numpy()))
            state, outcome = step(self.problem, state, actions, measure=self._measure)
            found[rows] += gamma**ahead * outcome.reward
        return found.numpy()
