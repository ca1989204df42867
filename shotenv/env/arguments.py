"""Arguments of environments and their spaces: what is checked as it enters, refused by name."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode

from shotenv.decision import FEATURES, LIMIT, TERMS
from unwrap.signal import Shots
from unwrap.support import in_short

OBSERVATIONS = ("features", "image")
RENDER_MODES = ("rgb_array", "human")
ACTIONS = len(Shots)
MOST_ENVS = 1_000_000
"""Largest batch: more drives at once only take memory."""
CHANNELS = ("gray", "last depth", "last validity")
IMAGE_SHAPE = (len(CHANNELS), 60, 80)


def feature_space() -> spaces.Box:
    """Space of the feature observation."""
    return spaces.Box(-LIMIT, LIMIT, (len(FEATURES),), np.float32)


def observation_space(observation: str) -> spaces.Space:
    """Space of one of the `OBSERVATIONS`."""
    if observation == "features":
        return feature_space()
    image = spaces.Box(0, 255, IMAGE_SHAPE, np.uint8)
    return spaces.Dict(image=image, state=feature_space())


def term_space() -> spaces.Box:
    """Space of `info["vector_reward"]`: the unweighted terms, each in 0..1."""
    return spaces.Box(0.0, 1.0, (len(TERMS),), np.float32)


def objective_space() -> spaces.Box:
    """Space of a reward that is a vector: minus each of the unweighted terms."""
    return spaces.Box(-1.0, 0.0, (len(TERMS),), np.float32)


def check_action(action: Any) -> int:
    """The action as an int.

    Raises
    ------
    ValueError
        It is not one of 0, 1, 2.
    """
    value = np.asarray(action)
    if value.shape != () or value.dtype.kind not in "iu" or not 0 <= value < ACTIONS:
        raise ValueError(
            f"action is {in_short(action)}; expected 0 (2 DCS), 1 (4 DCS) or 2 (8 DCS)"
        )
    return int(value)


def check_actions(actions: Any, num_envs: int) -> torch.Tensor:
    """Actions int64 [num_envs] of a vector environment.

    Raises
    ------
    ValueError
        They are not `num_envs` whole numbers 0, 1 or 2.
    """
    values = np.asarray(actions)
    whole = values.shape == (num_envs,) and values.dtype.kind in "iu"
    if not whole or values.min() < 0 or values.max() >= ACTIONS:
        raise ValueError(
            f"actions are {in_short(actions)}; expected {num_envs} whole numbers 0 (2 DCS), "
            "1 (4 DCS) or 2 (8 DCS)"
        )
    return torch.from_numpy(values.astype(np.int64))


def spec_of_drives(spec: EnvSpec | None, frames_per_drive: int) -> EnvSpec | None:
    """`spec` with the length of an episode, which is that of a drive.

    `gymnasium.make` would take it from the registry, where it cannot follow `frames_per_drive`.
    """
    if spec is None:
        return None
    spec = copy.copy(spec)
    spec.max_episode_steps = frames_per_drive
    return spec


def check_length(max_episode_steps: int | None, frames_per_drive: int) -> None:
    """Refuse another length of an episode than the drive's.

    A vector environment's spec hands it in again when it is made from that.

    Raises
    ------
    ValueError
        It is another.
    """
    if max_episode_steps not in (None, frames_per_drive):
        raise ValueError(
            f"max_episode_steps is {max_episode_steps!r} and frames_per_drive {frames_per_drive}; "
            "set frames_per_drive alone"
        )


def check_count(num_envs: Any) -> int:
    """Number of environments in a batch.

    Raises
    ------
    ValueError
        It is no whole number of 1 to `MOST_ENVS`.
    """
    if not isinstance(num_envs, int) or not 1 <= num_envs <= MOST_ENVS:
        raise ValueError(
            f"num_envs is {in_short(num_envs)}; expected a whole number of 1 to {MOST_ENVS}"
        )
    return num_envs


def check_autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    """Gymnasium's mode of this name.

    Raises
    ------
    ValueError
        It has none.
    """
    try:
        return AutoresetMode(mode)
    except ValueError:
        known = ", ".join(repr(known.value) for known in AutoresetMode)
        raise ValueError(f"autoreset_mode is {mode!r}; expected one of {known}") from None


def check_seeds(seed: int | Sequence[int | None] | None, num_envs: int) -> Sequence[int | None]:
    """Seed of each environment of a batch: of an int s those from s on.

    Raises
    ------
    ValueError
        Another number of seeds than environments.
    """
    if seed is None:
        return [None] * num_envs
    if isinstance(seed, int | np.integer):
        return [int(seed) + row for row in range(num_envs)]
    if len(seed) != num_envs:
        raise ValueError(f"seed has {len(seed)} values; expected {num_envs}")
    return seed


def check_reset_mask(mask: Any, num_envs: int) -> np.ndarray:
    """Which environments of a batch begin a new drive, bool [num_envs]; None is all.

    Raises
    ------
    ValueError
        It is no such array, or no environment begins.
    """
    if mask is None:
        return np.ones(num_envs, dtype=bool)
    fits = isinstance(mask, np.ndarray) and mask.shape == (num_envs,)
    if not fits or mask.dtype != bool or not mask.any():
        raise ValueError(f"reset_mask is {mask!r}; expected a bool array of {num_envs} with a True")
    return mask
