"""`gymnasium.vector.VectorEnv` faces of the transition: many drives in one batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from shotenv.bank import require_full
from shotenv.config import env_config
from shotenv.decision import (
    FEATURE_NAMES,
    TERMS,
    MeasurementCache,
    Outcome,
    State,
    allowed_actions,
    measure_frames,
    observe,
    open_problem,
    reset,
    step,
)
from shotenv.env.arguments import (
    ACTIONS,
    OBSERVATIONS,
    check_actions,
    check_autoreset_mode,
    check_count,
    check_length,
    check_reset_mask,
    check_seeds,
    objective_space,
    observation_space,
    spec_of_drives,
    term_space,
)
from shotenv.env.counterfactuals import no_outcomes, outcome_columns
from shotenv.env.drive_order import DriveOrder, check_drives
from shotenv.env.image_observation import depth_images, gray_images, no_depth_images
from shotenv.env.info import (
    Columns,
    family_codes,
    family_names,
    info_columns,
    merged_columns,
    rows_of,
    vector_info,
)
from shotenv.env.picture import Trace, paint_drive
from shotenv.env.reset_options import ResetOptions, check_options
from shotenv.env.single import objectives_of
from unwrap.support import put, require_choice, take

RENDER_MODES = ("rgb_array",)


class ShotScheduleVectorEnv(VectorEnv):
    """`ShotScheduleEnv` for `num_envs` drives at a time; each equals a single one with its seed.

    Parameters
    ----------
    num_envs
        Drives in the batch.
    config, observation, drives, remember, outcomes, **fields
        As for `ShotScheduleEnv`.
    render_mode
        None or "rgb_array".
    autoreset_mode
        "NextStep", "SameStep" or "Disabled", or gymnasium's enum.
    max_episode_steps
        As gymnasium hands it in from a spec; `frames_per_drive` or None.
    """

    def __init__(
        self,
        num_envs: int = 1,
        config: str = "default",
        *,
        observation: str = "features",
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        drives: int | None = None,
        remember: bool = False,
        outcomes: bool = False,
        max_episode_steps: int | None = None,
        **fields: Any,
    ) -> None:
        require_choice(OBSERVATIONS, observation=observation)
        self.observation = observation
        self.num_envs = check_count(num_envs)
        self.autoreset_mode = check_autoreset_mode(autoreset_mode)
        if render_mode is not None:
            require_choice(RENDER_MODES, render_mode=render_mode)
        self.render_mode = render_mode
        self._drives = check_drives(drives)
        self._outcomes = outcomes
        self.problem = open_problem(env_config(config, **fields))
        check_length(max_episode_steps, self.problem.config.frames_per_drive)
        if observation == "image":
            require_full(self.problem.bank, 'observation="image"')
        if render_mode is not None:
            require_full(self.problem.bank, f"render_mode={render_mode!r}")
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": self.problem.config.frame_rate_hz,
            "autoreset_mode": self.autoreset_mode,
        }
        self.feature_names = FEATURE_NAMES
        self.family_names = family_names(self.problem.bank)
        self.single_observation_space = observation_space(observation)
        self.single_action_space = spaces.Discrete(ACTIONS)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.reward_space = term_space()
        self.state: State | None = None
        self._family_codes = family_codes(self.problem.bank)
        self._measure = MeasurementCache() if remember else measure_frames
        # One for each drive, as single environments with these seeds have.
        self._generators = [seeding.np_random()[0] for _ in range(num_envs)]
        self._orders = [DriveOrder(self._drives) for _ in range(num_envs)]
        self._over = np.zeros(num_envs, dtype=bool)
        self._last_depth = no_depth_images(num_envs)
        self._traces: dict[int, Trace] = {}

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Start new drives; `options["reset_mask"]` (bool [N]) restricts it to some of them.

        Parameters
        ----------
        seed
            An int s seeds environment i with s + i; a sequence holds one seed per environment.
        options
            As for a single environment, for all drives that begin now; `drive` may also be a
            sequence with one seed per environment. Drives that begin by auto-reset are drawn.
        """
        chosen = check_options(options, self.problem, self.num_envs, also=("reset_mask",))
        mask = check_reset_mask((options or {}).get("reset_mask"), self.num_envs)
        # At first all drives begin, whatever is masked.
        rows = np.arange(self.num_envs) if self.state is None else np.flatnonzero(mask)
        for row, value in enumerate(check_seeds(seed, self.num_envs)):
            # A row that goes on with its drive leaves its seed unused: its next stays the same.
            if value is not None and row in rows:
                self._generators[row] = seeding.np_random(value)[0]
                self._orders[row] = DriveOrder(self._drives)
        columns = self._restart(rows, chosen)
        return self._observations(), vector_info(columns, rows, self.num_envs)

    def step(
        self, actions: np.ndarray
    ) -> tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Take the next frame of every drive.

        Raises
        ------
        ValueError
            The actions are not N whole numbers 0, 1 or 2, or ask for what was not recorded.
        ResetNeeded
            No drives have been started, or one is over and nothing resets it.
        """
        chosen = check_actions(actions, self.num_envs)
        if self.state is None or (
            self.autoreset_mode == AutoresetMode.DISABLED and any(self._over)
        ):
            raise gymnasium.error.ResetNeeded("a drive is not under way; call reset() first")
        # Over since the step before: in NextStep the action is ignored, and a new drive starts.
        resting = self._over.copy()
        rewards = self._no_rewards()
        playing, restarted = np.flatnonzero(~resting), np.flatnonzero(resting)
        # Rows and what is told of them: of those that play, and of those that begin a new drive.
        parts: list[tuple[np.ndarray, Columns]] = []
        if len(playing):
            told, rewards[playing] = self._play(playing, chosen)
            parts.append((playing, told))
        truncated = self._over & ~resting
        final: dict[str, Any] = {}
        if self.autoreset_mode == AutoresetMode.SAME_STEP and truncated.any():
            # No row rests in this mode, so that `told` is of all of them. Those that are over begin
            # anew within this step, and what was told of their last frame goes to `final_info`.
            restarted = np.flatnonzero(truncated)
            final = self._final(rows_of(told, restarted), restarted)
            going = np.flatnonzero(~truncated)
            parts = [(going, rows_of(told, going))]
        if len(restarted):
            parts.append((restarted, self._restart(restarted)))
        rows, columns = merged_columns(parts)
        none = np.zeros(self.num_envs, dtype=bool)
        infos = vector_info(columns, rows, self.num_envs) | final
        return self._observations(), rewards, none, truncated, infos

    def action_masks(self) -> np.ndarray:
        """Which actions can be taken now, bool [N, 3]; see `ShotScheduleEnv.action_masks`."""
        return allowed_actions(self.problem, self._under_way()).numpy()

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Pictures of the last frames; None without a render mode."""
        if self.render_mode is None:
            return None
        self._under_way()
        return tuple(paint_drive(self.problem, self._traces[row]) for row in range(self.num_envs))

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """How `gymnasium.make_vec` made this environment; an episode is as long as a drive."""
        return getattr(self, "_spec", None)

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec_of_drives(spec, self.problem.config.frames_per_drive)

    def _rewards(self, outcome: Outcome) -> np.ndarray:
        return outcome.reward.numpy()

    def _no_rewards(self) -> np.ndarray:
        return np.zeros(self.num_envs)

    def _play(self, rows: np.ndarray, actions: torch.Tensor) -> tuple[Columns, np.ndarray]:
        """Play one frame of the drives `rows`: their infos and rewards."""
        index, before = torch.from_numpy(rows), self._under_way()
        # Picking rows copies maps of whole images; most steps play all drives.
        whole = len(rows) == self.num_envs
        part = before if whole else take(before, index)
        after, outcome = step(self.problem, part, actions[index], measure=self._measure)
        self.state = after if whole else put(before, index, after)
        self._over[rows] = outcome.truncated.numpy()
        if self.observation == "image":
            self._last_depth[rows] = depth_images(self.problem, part, outcome.shots)
        columns = info_columns(self.problem, self._family_codes, part, after, outcome)
        if self._outcomes:
            columns["outcomes"] = outcome_columns(
                self.problem, self._family_codes, part, self._measure
            )
        if self.render_mode is not None:
            told = ("shots", "temperature_k", "laser_energy_j")
            for place, row in enumerate(rows.tolist()):
                numbers = (columns[name][place].item() for name in told)
                one = take(part, torch.tensor([place]))
                self._traces[row] = self._traces[row].after(one, *numbers)
        return columns, self._rewards(outcome)

    def _restart(self, rows: np.ndarray, chosen: ResetOptions | None = None) -> Columns:
        """Start new drives in `rows`: their infos."""
        chosen = chosen or check_options(None, self.problem, self.num_envs)
        seeds = [
            chosen.seeds[row]
            if chosen.seeds
            else self._orders[row].next_seed(self._generators[row])
            for row in rows
        ]
        fresh = reset(self.problem, seeds, chosen.drive)
        whole = len(rows) == self.num_envs
        self.state = fresh if whole else put(self.state, torch.from_numpy(rows), fresh)
        self._over[rows] = False
        self._last_depth[rows] = no_depth_images(len(rows))
        if self.render_mode is not None:
            for place, row in enumerate(rows.tolist()):
                self._traces[row] = Trace.start(take(fresh, torch.tensor([place])))
        columns = info_columns(self.problem, self._family_codes, fresh)
        if self._outcomes:
            columns["outcomes"] = no_outcomes(columns)
        return columns

    def _final(self, columns: Columns, rows: np.ndarray) -> dict[str, Any]:
        """Last infos and observations of the drives `rows`, as gymnasium has them."""
        over = np.zeros(self.num_envs, dtype=bool)
        over[rows] = True
        last, each = self._observations(), np.full(self.num_envs, None, dtype=object)
        for row in rows:
            if isinstance(last, dict):
                each[row] = {name: part[row] for name, part in last.items()}
            else:
                each[row] = last[row]
        return {
            "final_obs": each,
            "_final_obs": over,
            "final_info": vector_info(columns, rows, self.num_envs),
            "_final_info": over.copy(),
        }

    def _under_way(self) -> State:
        if self.state is None:
            raise gymnasium.error.ResetNeeded("no drives are under way; call reset() first")
        return self.state

    def _observations(self) -> Any:
        state = self._under_way()
        features = observe(self.problem, state).numpy()
        if self.observation == "features":
            return features
        gray = gray_images(self.problem, state.drive.frame(state.step))
        image = np.concatenate((gray[:, None], self._last_depth), axis=1)
        return {"image": image, "state": features}


class MOShotScheduleVectorEnv(ShotScheduleVectorEnv):
    """`MOShotScheduleEnv` for `num_envs` drives at a time: rewards float32 [N, objectives]."""

    def __init__(self, num_envs: int = 1, config: str = "default", **keywords: Any) -> None:
        super().__init__(num_envs, config, **keywords)
        self.reward_space = objective_space()
        self.reward_dim = len(TERMS)
        self.objectives = TERMS

    def _rewards(self, outcome: Outcome) -> np.ndarray:
        return objectives_of(outcome)

    def _no_rewards(self) -> np.ndarray:
        return np.zeros((self.num_envs, len(TERMS)), np.float32)
