"""A gymnasium vector environment as stable-baselines3 wants to see one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.vec_env import VecEnv


class Sb3VecEnv(VecEnv):
    """Adapter from a batched `gymnasium.vector.VectorEnv` to stable-baselines3's `VecEnv`.

    stable-baselines3 expects an environment that has ended to be reset within the same step, its
    last observation under `infos[i]["terminal_observation"]`, and `infos[i]["TimeLimit.truncated"]`
    where it ended by truncation alone.

    Parameters
    ----------
    envs : gymnasium.vector.VectorEnv
        Made with `autoreset_mode="SameStep"`.

    Raises
    ------
    ValueError
        Another autoreset mode.
    """

    def __init__(self, envs: VectorEnv) -> None:
        if not isinstance(envs, VectorEnv):
            raise TypeError(f"envs is {type(envs).__name__}; expected a vector of environments")
        # Under `NextStep` an ended drive takes one more step, whose action is ignored: a learner
        # would learn from it.
        mode = envs.metadata.get("autoreset_mode")
        if mode != AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode is {mode}; stable-baselines3 needs SameStep")
        self.envs = envs
        self._actions: np.ndarray | None = None
        self._reset_with: list[int | None] | None = None
        super().__init__(envs.num_envs, envs.single_observation_space, envs.single_action_space)

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Seeds of the environments at the next `reset`: `seed`, `seed` + 1 and so on."""
        self._reset_with = list(super().seed(seed))
        return self._reset_with

    def seed_all(self, seeds: Sequence[int]) -> None:
        """Seeds of the environments at the next `reset`, one each."""
        self._reset_with = list(seeds)

    def reset(self) -> Any:
        """Start all environments anew; seeds that were given count once."""
        # A sequence with one seed per environment; gymnasium's annotation forgets it.
        seeds: Any = self._reset_with
        observations, infos = self.envs.reset(seed=seeds)
        self.reset_infos = split_infos(infos, self.num_envs)
        self._reset_with = None
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Step all environments with the kept actions."""
        observations, rewards, terminated, truncated, infos = self.envs.step(self._actions)
        dones = np.logical_or(terminated, truncated)
        each = split_infos(infos, self.num_envs)
        for i in np.flatnonzero(dones):
            # The info of the ended episode, not that of the new episode's first frame.
            each[i] = {
                **each[i].get("final_info", {}),
                "terminal_observation": infos["final_obs"][i],
                "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
            }
        # float32, as stable-baselines3's own environments return them.
        return observations, rewards.astype(np.float32), dones, each

    def close(self) -> None:
        """Release the environments."""
        self.envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the batch, once per chosen environment."""
        # stable-baselines3 asks so for `render_mode` when it is built.
        return [getattr(self.envs, attr_name) for _ in self._chosen(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: the batch has no environments of its own to set attributes on."""
        raise NotImplementedError(f"cannot set {attr_name} on environments of a native batch")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: the batch has no environments of its own to call."""
        raise NotImplementedError(f"cannot call {method_name} on environments of a native batch")

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """No environment of a native batch is wrapped."""
        return [False for _ in self._chosen(indices)]

    def _chosen(self, indices: int | Iterable[int] | None) -> Iterable[int]:
        """Numbers of the environments that `indices` picks: all, one, or some."""
        if indices is None:
            return range(self.num_envs)
        return [indices] if isinstance(indices, int) else indices

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Nothing: a batch is not drawn."""
        return [None] * self.num_envs


def split_infos(infos: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """One dictionary per environment from gymnasium's dictionary of arrays.

    A value belongs to an environment where its mask `_key` says so; nested dictionaries are split
    alike.
    """
    each: list[dict[str, Any]] = [{} for _ in range(count)]
    for key, values in infos.items():
        if key.startswith("_"):
            continue
        held = infos.get(f"_{key}")
        # Without a mask, as of an environment that is batched itself, all have the value.
        holders = range(count) if held is None else np.flatnonzero(held)
        parts = split_infos(values, count) if isinstance(values, dict) else values
        for i in holders:
            each[i][key] = parts[i]
    return each
