"""Rewards for training in which the frame's own difficulty cancels."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from agents.policies import ThermalGuard
from agents.training.sb3_vector import Sb3VecEnv
from shotenv.env import ShotScheduleVectorEnv
from unwrap.signal import Shots

LOWEST: Final = -0.25
"""Floor of a training reward (assumed). A frame without laser costs some ten times what choices
differ by; at a few times that a trip deters as surely and does not drown the rest of its batch."""


class PairedVecEnv(Sb3VecEnv):
    """Adapter whose rewards are relative to what 4 DCS would have brought in the same frame.

    How hard a frame is varies far more than what the choice of shots changes. The error of 4 DCS
    in the same frame with the same noise is known, and no action changes it: adding it to the
    reward leaves the best policy as it is (a control variate) and takes most of the noise away.

    Parameters
    ----------
    envs : ShotScheduleVectorEnv
        Made with `autoreset_mode="SameStep"`, best with `remember=True`.
    guard : ThermalGuard
        Stands between the learner and the laser, as it will when the scheduler is used.
    """

    def __init__(self, envs: ShotScheduleVectorEnv, guard: ThermalGuard) -> None:
        super().__init__(envs)
        self._native, self._guard = envs, guard
        self._observed: np.ndarray | None = None

    def reset(self) -> Any:
        """Start all environments anew."""
        self._observed = super().reset()
        return self._observed

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions that the guard allows for `step_wait`."""
        super().step_async(self._guard(self._observed, actions))

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments with the kept actions."""
        # Before the step, which goes on to the next frame. In rewards the error counts negative:
        # adding that of 4 DCS leaves what the chosen shots do better or worse.
        usual = self._native.problem.config.reward.error * self._native.error_of(Shots.FOUR)
        observations, rewards, dones, infos = super().step_wait()
        self._observed = observations
        return observations, np.maximum(rewards + usual, LOWEST).astype(np.float32), dones, infos
