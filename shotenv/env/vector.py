"""`gymnasium.vector.VectorEnv` face of the transition: many drives in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from shotenv.config import env_config
from shotenv.decision import (
    FEATURE_NAMES,
    MeasurementCache,
    State,
    measure_frames,
    observe,
    open_problem,
    reset,
    step,
)
from shotenv.env.info import reset_infos, step_infos
from shotenv.env.picture import paint_frame
from shotenv.env.single import (
    ACTIONS,
    RENDER_MODES,
    check_observation,
    check_render_mode,
    drive_seed,
    feature_space,
    reward_space,
)
from unwrap.support import put, take


class ShotScheduleVectorEnv(VectorEnv):
    """`ShotScheduleEnv` for `num_envs` drives at a time; each equals a single one with its seed.

    Parameters
    ----------
    num_envs
        Drives in the batch.
    config, observation, render_mode, **fields
        As for `ShotScheduleEnv`.
    autoreset_mode
        "NextStep", "SameStep" or "Disabled", or gymnasium's enum.
    remember
        Keep what was measured (`MeasurementCache`): the same numbers, faster where drives come
        again.
    """

    def __init__(
        self,
        num_envs: int = 1,
        config: str = "default",
        *,
        observation: str = "features",
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        remember: bool = False,
        **fields: Any,
    ) -> None:
        check_observation(observation)
        self.num_envs = _check_count(num_envs)
        self.autoreset_mode = _check_mode(autoreset_mode)
        self.render_mode = check_render_mode(render_mode)
        self.problem = open_problem(env_config(config, **fields))
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": self.problem.config.frame_rate_hz,
            "autoreset_mode": self.autoreset_mode,
        }
        self.feature_names = FEATURE_NAMES
        self.single_observation_space = feature_space()
        self.single_action_space = spaces.Discrete(ACTIONS)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.reward_space = reward_space()
        self.state: State | None = None
        self._measure = MeasurementCache() if remember else measure_frames
        # One for each drive, as single environments with these seeds have.
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._over = np.zeros(num_envs, dtype=bool)
        self._shown: dict[int, tuple[State, int]] = {}

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start new drives; `options["reset_mask"]` (bool [N]) restricts it to some of them.

        Parameters
        ----------
        seed
            An int s seeds environment i with s + i; a sequence holds one seed per environment.
        """
        rows = np.flatnonzero(self._check_reset_mask(options))
        for row, value in enumerate(self._check_seeds(seed)):
            # A row that goes on with its drive leaves its seed unused: its next stays the same.
            if value is not None and row in rows:
                self._generators[row] = seeding.np_random(value)[0]
        infos = self._restart(rows)
        return self._observations(), self._batched(infos)

    def step(
        self, actions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take the next frame of every drive.

        Raises
        ------
        ValueError
            The actions are not N whole numbers 0, 1 or 2.
        ResetNeeded
            No drives have been started, or one is over and nothing resets it.
        """
        chosen = self._check_actions(actions)
        if self.state is None or (
            self.autoreset_mode == AutoresetMode.DISABLED and any(self._over)
        ):
            raise gymnasium.error.ResetNeeded("a drive is not under way; call reset() first")
        # Over since the step before: in NextStep the action is ignored, and a new drive starts.
        resting, rewards = self._over.copy(), np.zeros(self.num_envs)
        infos, rewards[~resting] = self._play(np.flatnonzero(~resting), chosen)
        truncated = self._over & ~resting
        restarted = resting
        if self.autoreset_mode == AutoresetMode.SAME_STEP:
            # Of the drives that are over; below, new ones take their place in the state.
            restarted, last = truncated, self._observations()
            for row in np.flatnonzero(truncated).tolist():
                infos[row] = {"final_obs": last[row], "final_info": infos[row]}
        for row, info in self._restart(np.flatnonzero(restarted)).items():
            # In SameStep beside the final ones; in NextStep the row has not played, and has none.
            infos[row] = infos.get(row, {}) | info
        none = np.zeros(self.num_envs, dtype=bool)
        return self._observations(), rewards, none, truncated, self._batched(infos)

    def _play(
        self, rows: np.ndarray, actions: torch.Tensor
    ) -> tuple[dict[int, dict[str, Any]], np.ndarray]:
        """Play one frame of the drives `rows`: their infos by row, and their rewards."""
        if not len(rows):
            return {}, np.zeros(0)
        index, before = torch.from_numpy(rows), self._under_way()
        # Picking rows copies maps of whole images; most steps play all drives.
        whole = len(rows) == self.num_envs
        part = before if whole else take(before, index)
        after, outcome = step(self.problem, part, actions[index], measure=self._measure)
        self.state = after if whole else put(before, index, after)
        self._over[rows] = outcome.truncated.numpy()
        self._show(rows, part, outcome.shots.tolist())
        infos = step_infos(self.problem, part, after, outcome)
        return dict(zip(rows.tolist(), infos, strict=True)), outcome.reward.numpy()

    def _restart(self, rows: np.ndarray) -> dict[int, dict[str, Any]]:
        """Start new drives in `rows`: their infos by row."""
        if not len(rows):
            return {}
        fresh = reset(self.problem, [drive_seed(self._generators[row]) for row in rows])
        whole = len(rows) == self.num_envs
        self.state = fresh if whole else put(self.state, torch.from_numpy(rows), fresh)
        self._over[rows] = False
        self._show(rows, fresh, [0] * len(rows))
        infos = reset_infos(self.problem, fresh)
        return dict(zip(rows.tolist(), infos, strict=True))

    def _show(self, rows: np.ndarray, part: State, shots: list[int]) -> None:
        """Remember what `render` would draw."""
        if self.render_mode is not None:
            for place, row in enumerate(rows.tolist()):
                self._shown[row] = take(part, torch.tensor([place])), shots[place]

    def _batched(self, infos: dict[int, dict[str, Any]]) -> dict[str, Any]:
        """Infos by row as gymnasium has them: one array for each key, and which rows it is of."""
        batch: dict[str, Any] = {}
        for row in sorted(infos):
            batch = self._add_info(batch, infos[row], row)
        return batch

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Pictures of the last frames; None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(paint_frame(self.problem, *self._shown[row]) for row in range(self.num_envs))

    def _under_way(self) -> State:
        if self.state is None:
            raise gymnasium.error.ResetNeeded("no drives are under way; call reset() first")
        return self.state

    def _observations(self) -> np.ndarray:
        return observe(self.problem, self._under_way()).numpy()

    def _check_actions(self, actions: Any) -> torch.Tensor:
        values = np.asarray(actions)
        whole = values.shape == (self.num_envs,) and values.dtype.kind in "iu"
        if not whole or values.min() < 0 or values.max() >= ACTIONS:
            raise ValueError(
                f"actions are {actions!r}; expected {self.num_envs} whole numbers 0 (2 DCS), "
                "1 (4 DCS) or 2 (8 DCS)"
            )
        return torch.from_numpy(values.astype(np.int64))

    def _check_seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + row for row in range(self.num_envs)]
        if len(seed) != self.num_envs:
            raise ValueError(f"seed has {len(seed)} values; expected {self.num_envs}")
        return seed

    def _check_reset_mask(self, options: dict[str, Any] | None) -> np.ndarray:
        everything = np.ones(self.num_envs, dtype=bool)
        mask = (options or {}).get("reset_mask", everything)
        fits = isinstance(mask, np.ndarray) and mask.shape == (self.num_envs,)
        if not fits or mask.dtype != bool or not mask.any():
            raise ValueError(
                f"reset_mask is {mask!r}; expected a bool array of {self.num_envs} with a True"
            )
        return everything if self.state is None else mask


def _check_count(num_envs: Any) -> int:
    if not isinstance(num_envs, int) or num_envs < 1:
        raise ValueError(f"num_envs is {num_envs!r}; expected a whole number of at least 1")
    return num_envs


def _check_mode(mode: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = ", ".join(repr(known.value) for known in AutoresetMode)
        raise ValueError(f"autoreset_mode is {mode!r}; expected one of {known}") from None
