"""DQN and QR-DQN training of a scheduler; the best policy on validation drives is kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.utils import LinearSchedule

from agents.config import AgentConfig
from agents.policies import NetworkPolicy
from agents.training.checkpoint import Validate
from agents.training.contrib import contrib_learner
from agents.training.rounds import RoundTrainer
from agents.training.sb3_vector import Sb3VecEnv
from shotenv.config import EnvConfig

REMEMBERED: Final = (
    "observations",
    "next_observations",
    "actions",
    "rewards",
    "dones",
    "timeouts",
)
"""Arrays of the replay buffer, a row for each step of all environments."""


class QLearner(RoundTrainer):
    """One run of DQN, or of QR-DQN, in the folder `out`.

    Checkpoints hold the steps that it learns from, too: some 50 MB at the default size; when the
    run is over they are left out.

    Parameters
    ----------
    envs : Sb3VecEnv
        `config.dqn.num_envs` environments.
    frames_per_drive : int
        Length of an episode; a round is whole drives.
    config : AgentConfig
        Its `algorithm` is "dqn" or "qrdqn".
    feature_names, validate, out, env
        See `RoundTrainer`.
    """

    def __init__(
        self,
        envs: Sb3VecEnv,
        feature_names: Sequence[str],
        frames_per_drive: int,
        config: AgentConfig,
        validate: Validate,
        out: Path,
        env: EnvConfig | None = None,
    ) -> None:
        learner = config.dqn
        drives = frames_per_drive * learner.num_envs
        super().__init__(
            envs,
            feature_names,
            config,
            validate,
            out,
            round_steps=math.ceil(learner.total_steps / learner.validations / drives) * drives,
            total_steps=learner.total_steps,
            env=env,
        )
        self._quantiles = config.algorithm == "qrdqn"
        form: dict[str, Any] = {"net_arch": list(config.hidden)}
        if self._quantiles:
            form["n_quantiles"] = learner.quantiles
        algorithm: Any = contrib_learner("QRDQN", "qrdqn") if self._quantiles else DQN
        self.model = algorithm(
            "MlpPolicy",
            envs,
            learning_rate=learner.learning_rate,
            buffer_size=learner.buffer_size,
            learning_starts=learner.learning_starts,
            batch_size=learner.batch_size,
            gamma=learner.gamma,
            train_freq=1,
            gradient_steps=learner.gradient_steps,
            target_update_interval=learner.target_update,
            policy_kwargs=form,
            seed=config.seed,
            device="cpu",  # two small layers: copying to a GPU would take longer
        )
        # By the steps of the whole run: stable-baselines3 would count those of each `learn`.
        falling = LinearSchedule(1.0, learner.epsilon, learner.exploration)
        steps = self.rounds * self.round_steps
        self.model.exploration_schedule = lambda remaining: falling(
            1.0 - self.model.num_timesteps / steps
        )

    @property
    def policy(self) -> NetworkPolicy:
        """The network as it is now."""
        if self._quantiles:
            return NetworkPolicy.from_qr_dqn(self.model.quantile_net, self._provenance)
        return NetworkPolicy.from_dqn(self.model.q_net, self._provenance)

    def drives(self, generator: np.random.Generator) -> list[int]:
        """New ones: each is played once."""
        return generator.integers(2**31, size=self._config.dqn.num_envs).tolist()

    def learn(self, rounds: int, callback: BaseCallback) -> None:
        """Play and learn for one round, after `rounds` others."""
        steps = rounds * self.round_steps
        # Counted on from the rounds before, whether they were played by this process or another;
        # without a last observation the environments are reset first. As its own `load` does it.
        counted = {"num_timesteps": steps, "_n_calls": steps // self._envs.num_envs}
        vars(self.model).update(counted, _last_obs=None)
        self.model.learn(self.round_steps, callback=callback, reset_num_timesteps=False)

    def memory(self, rounds: int) -> dict[str, torch.Tensor]:
        """The steps that it learns from; none when the run is over."""
        if rounds >= self.rounds:
            return {}
        buffer = self.model.replay_buffer
        filled = buffer.buffer_size if buffer.full else buffer.pos
        return {
            f"replay.{name}": torch.from_numpy(getattr(buffer, name)[:filled])
            for name in REMEMBERED
        } | {"replay.pos": torch.tensor(buffer.pos)}

    def remember(self, memory: dict[str, torch.Tensor]) -> None:
        """Inverse of `memory`."""
        if not memory:
            return
        buffer = self.model.replay_buffer
        for name in REMEMBERED:
            rows = memory[f"replay.{name}"].numpy()
            getattr(buffer, name)[: len(rows)] = rows
        buffer.pos = int(memory["replay.pos"])
        buffer.full = len(memory["replay.rewards"]) == buffer.buffer_size
