"""`gymnasium.Env` face of the transition: a batch of one drive."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces

from shotenv.config import env_config
from shotenv.decision import (
    FEATURE_NAMES,
    FEATURES,
    LIMIT,
    TERMS,
    State,
    observe,
    open_problem,
    reset,
    step,
)
from shotenv.env.info import reset_infos, step_infos
from shotenv.env.picture import paint_frame
from unwrap.signal import Shots

RENDER_MODES = ("rgb_array",)
OBSERVATIONS = ("features",)
ACTIONS = len(Shots)


def feature_space() -> spaces.Box:
    """Space of the feature observation."""
    return spaces.Box(-LIMIT, LIMIT, (len(FEATURES),), np.float32)


def reward_space() -> spaces.Box:
    """Space of `info["vector_reward"]`: the unweighted terms, each in 0..1."""
    return spaces.Box(0.0, 1.0, (len(TERMS),), np.float32)


def check_action(action: Any) -> int:
    """The action as an int.

    Raises
    ------
    ValueError
        It is not one of 0, 1, 2.
    """
    value = np.asarray(action)
    if value.shape != () or value.dtype.kind not in "iu" or not 0 <= value < ACTIONS:
        raise ValueError(f"action is {action!r}; expected 0 (2 DCS), 1 (4 DCS) or 2 (8 DCS)")
    return int(value)


def check_render_mode(render_mode: str | None) -> str | None:
    """The render mode, or ValueError naming it."""
    if render_mode is not None and render_mode not in RENDER_MODES:
        raise ValueError(f"render_mode is {render_mode!r}; expected None or one of {RENDER_MODES}")
    return render_mode


def check_observation(observation: str) -> None:
    """Refuse a kind of observation that there is not.

    Raises
    ------
    ValueError
        It is not one of `OBSERVATIONS`.
    """
    if observation not in OBSERVATIONS:
        raise ValueError(f"observation is {observation!r}; expected one of {OBSERVATIONS}")


def drive_seed(generator: np.random.Generator) -> int:
    """Seed of the next drive."""
    # Seeds of drives are kept in int64 tensors, so they stay below 2^63.
    return int(generator.integers(2**62))


class ShotScheduleEnv(gymnasium.Env[np.ndarray, np.int64]):
    """Choose 2, 4 or 8 samples for every frame of a drive.

    Parameters
    ----------
    config
        Name in `configs/env/`, or path, of the configuration that `fields` change.
    observation
        "features", the only kind.
    render_mode
        None or "rgb_array".
    **fields
        Fields of `shotenv.config.env.EnvConfig` as plain JSON values, such as `bank="starter"`,
        `split="test"`, `reward={"power": 0.2}`, `laser={"efficiency": 0.45}`.

    Attributes
    ----------
    feature_names : tuple of str
        Name of each element of the observation; `shotenv.decision.FEATURES` explains them.
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
        **fields: Any,
    ) -> None:
        check_observation(observation)
        self.render_mode = check_render_mode(render_mode)
        self.problem = open_problem(env_config(config, **fields))
        # Of this environment, where the class can only tell the usual: a film plays in real time.
        self.metadata = {**self.metadata, "render_fps": self.problem.config.frame_rate_hz}
        self.feature_names = FEATURE_NAMES
        self.observation_space = feature_space()
        self.action_space = spaces.Discrete(ACTIONS)
        self.reward_space = reward_space()
        self.state: State | None = None
        # What `render` paints: the state before the last step, and the shots that it took.
        self._shown: tuple[State, int] | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Start a new drive."""
        super().reset(seed=seed)
        state = reset(self.problem, [drive_seed(self.np_random)])
        self.state, self._shown = state, (state, 0)
        return self._observed(state), reset_infos(self.problem, state)[0]

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Take the frame with the shots of `action`.

        Raises
        ------
        ValueError
            The action is not 0, 1 or 2.
        ResetNeeded
            No drive has been started, or it is over.
        """
        chosen = torch.tensor([check_action(action)])
        before = self.state
        if before is None or int(before.step) >= self.problem.config.frames_per_drive:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        after, outcome = step(self.problem, before, chosen)
        self.state, self._shown = after, (before, int(outcome.shots))
        info = step_infos(self.problem, before, after, outcome)[0]
        reward, truncated = float(outcome.reward), bool(outcome.truncated)
        return self._observed(after), reward, False, truncated, info

    def render(self) -> np.ndarray | None:
        """Picture uint8 [h, w, 3] of the last frame; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._shown is None:
            raise gymnasium.error.ResetNeeded("no drive is under way; call reset() first")
        return paint_frame(self.problem, *self._shown)

    def _observed(self, state: State) -> np.ndarray:
        return observe(self.problem, state)[0].numpy()
