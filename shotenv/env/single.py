"""`gymnasium.Env` faces of the transition: a batch of one drive."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec

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
    RENDER_MODES,
    check_action,
    objective_space,
    observation_space,
    spec_of_drives,
    term_space,
)
from shotenv.env.counterfactuals import no_outcomes, outcome_columns
from shotenv.env.drive_order import DriveOrder, check_drives
from shotenv.env.image_observation import depth_images, gray_images, no_depth_images
from shotenv.env.info import family_codes, family_names, info_columns, info_of
from shotenv.env.picture import Trace, paint_drive
from shotenv.env.reset_options import check_options
from unwrap.support import require_choice


class ShotScheduleEnv(gymnasium.Env[Any, np.int64]):
    """Choose 2, 4 or 8 samples for every frame of a drive.

    Parameters
    ----------
    config
        Name in `configs/env/`, or path, of the configuration that `fields` change.
    observation
        "features", or "image": a dictionary of `image`, uint8 [3, 60, 80], and `state`, the
        features.
    render_mode
        None, "rgb_array", or "human": a window, which needs pygame-ce.
    drives
        Play the drives of seeds 0 to `drives` - 1 again and again, in an order that follows from
        the environment's seed; None plays new ones.
    remember
        Keep what was measured (`MeasurementCache`): the same numbers, faster where drives come
        again.
    outcomes
        Tell in `info["outcomes"]` what every action would have brought: three times the work.
    **fields
        Fields of `shotenv.config.env.EnvConfig` as plain JSON values, such as `bank="starter"`,
        `split="test"`, `reward={"power": 0.04}`, `laser={"efficiency": 0.45}`.

    Attributes
    ----------
    feature_names : tuple of str
        Name of each element of the features; `shotenv.decision.FEATURES` explains them.
    family_names : tuple of str
        Name of each scene family by its code in `info["family"]`.
    reward_space : Box
        Of `info["vector_reward"]`.

    Examples
    --------
    >>> import gymnasium, shotenv
    >>> env = gymnasium.make("shotenv/ShotSchedule-v0")                # doctest: +SKIP
    >>> observation, info = env.reset(seed=0)                          # doctest: +SKIP
    """

    metadata = {"render_modes": list(RENDER_MODES), "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        config: str = "default",
        *,
        observation: str = "features",
        render_mode: str | None = None,
        drives: int | None = None,
        remember: bool = False,
        outcomes: bool = False,
        **fields: Any,
    ) -> None:
        require_choice(OBSERVATIONS, observation=observation)
        self.observation = observation
        if render_mode is not None:
            require_choice(RENDER_MODES, render_mode=render_mode)
        self.render_mode = render_mode
        self._drives = check_drives(drives)
        self._outcomes = outcomes
        self.problem = open_problem(env_config(config, **fields))
        if observation == "image":
            require_full(self.problem.bank, 'observation="image"')
        if render_mode is not None:
            require_full(self.problem.bank, f"render_mode={render_mode!r}")
        # Of this environment, where the class can only tell the usual: a film plays in real time.
        self.metadata = {**self.metadata, "render_fps": self.problem.config.frame_rate_hz}
        self.feature_names = FEATURE_NAMES
        self.family_names = family_names(self.problem.bank)
        self.observation_space = observation_space(observation)
        self.action_space = spaces.Discrete(ACTIONS)
        self.reward_space = term_space()
        self.state: State | None = None
        self._family_codes = family_codes(self.problem.bank)
        self._measure = MeasurementCache() if remember else measure_frames
        self._order = DriveOrder(self._drives)
        self._last_depth = no_depth_images(1)
        self._trace: Trace | None = None
        self._window: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start a new drive.

        Parameters
        ----------
        options
            `drive`, the seed of the drive to play (`info["drive_seed"]` tells it); `families`,
            those that its clips are of; `laser_power_w`, `integration_s`, `ambient_k`, set instead
            of drawn.

        Raises
        ------
        ValueError
            An unknown option, or a value that is of no use.
        """
        chosen = check_options(options, self.problem)
        super().reset(seed=seed)
        if seed is not None:
            self._order = DriveOrder(self._drives)
        # A drive that was asked for takes no random number: the next one is what it would be.
        seeds = chosen.seeds or (self._order.next_seed(self.np_random),)
        state = self.state = reset(self.problem, seeds, chosen.drive)
        self._last_depth = no_depth_images(1)
        if self.render_mode is not None:
            self._trace = Trace.start(state)
            self._show_human()
        columns = info_columns(self.problem, self._family_codes, state)
        if self._outcomes:
            columns["outcomes"] = no_outcomes(columns)
        return self._observed(state), info_of(columns, 0)

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Take the frame with the shots of `action`.

        Raises
        ------
        ValueError
            The action is not 0, 1 or 2, or asks for samples that were not recorded.
        ResetNeeded
            No drive has been started, or it is over.
        """
        chosen = torch.tensor([check_action(action)])
        before = self.state
        if before is None or int(before.step) >= self.problem.config.frames_per_drive:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        after, outcome = step(self.problem, before, chosen, measure=self._measure)
        self.state = after
        if self.observation == "image":
            self._last_depth = depth_images(self.problem, before, outcome.shots)
        if self._trace is not None:
            self._trace = self._trace.after(
                before,
                int(outcome.shots),
                float(after.laser.temperature_k),
                float(outcome.cost.laser_energy_j),
            )
            self._show_human()
        columns = info_columns(self.problem, self._family_codes, before, after, outcome)
        if self._outcomes:
            columns["outcomes"] = outcome_columns(
                self.problem, self._family_codes, before, self._measure
            )
        truncated = bool(outcome.truncated)
        return self._observed(after), self._reward(outcome), False, truncated, info_of(columns, 0)

    def render(self) -> np.ndarray | None:
        """Picture uint8 [h, w, 3] of the last frame and the drive so far.

        None without a render mode, and with "human", whose window is drawn as frames are played.
        """
        if self.render_mode is None:
            return None
        if self._trace is None:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        return paint_drive(self.problem, self._trace) if self.render_mode == "rgb_array" else None

    def action_masks(self) -> np.ndarray:
        """Which actions can be taken now, bool [3]: others would trip the laser.

        Of recordings those alone that they answer.
        """
        if self.state is None:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        return allowed_actions(self.problem, self.state)[0].numpy()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._window is not None:
            self._window.close()
            self._window = None

    @property
    def spec(self) -> EnvSpec | None:  # type: ignore[override]
        """How `gymnasium.make` made this environment; an episode is as long as a drive."""
        return getattr(self, "_spec", None)

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = spec_of_drives(spec, self.problem.config.frames_per_drive)

    def _reward(self, outcome: Outcome) -> Any:
        return float(outcome.reward)

    def _observed(self, state: State) -> Any:
        features = observe(self.problem, state)[0].numpy()
        if self.observation == "features":
            return features
        gray = gray_images(self.problem, state.drive.frame(state.step))
        return {"image": np.concatenate((gray, self._last_depth[0])), "state": features}

    def _show_human(self) -> None:
        if self.render_mode == "human" and self._trace is not None:
            from shotenv.env.window import Window

            if self._window is None:
                self._window = Window(self.metadata["render_fps"])
            self._window.show(paint_drive(self.problem, self._trace))


class MOShotScheduleEnv(ShotScheduleEnv):
    """`ShotScheduleEnv` whose reward is a vector, by the conventions of mo-gymnasium.

    The reward, float32 in `reward_space`, holds minus each of the unweighted terms in the order of
    `objectives`: the depth error, laser duty and power, each in 0..1, and 1 in a frame without
    laser. A weighted sum of it is the scalar reward but for what no action changes.
    """

    def __init__(self, config: str = "default", **keywords: Any) -> None:
        super().__init__(config, **keywords)
        self.reward_space = objective_space()
        self.reward_dim = len(TERMS)
        self.objectives = TERMS

    def _reward(self, outcome: Outcome) -> np.ndarray:
        return objectives_of(outcome)[0]


def objectives_of(outcome: Outcome) -> np.ndarray:
    """Minus the unweighted terms of each drive, float32 [B, len(TERMS)]."""
    terms = torch.stack([outcome.terms[name] for name in TERMS], dim=1)
    # Subtracted and not negated, which would make -0 of 0.
    return (0.0 - terms).to(torch.float32).numpy()
