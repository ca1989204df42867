"""PPO training of a scheduler, or RecurrentPPO; what an LSTM remembers begins with its drive."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy

from agents.config import AgentConfig
from agents.policies import NetworkPolicy, RecurrentPolicy, Scheduler
from agents.training.checkpoint import Validate, training_drives
from agents.training.contrib import contrib_learner
from agents.training.rounds import RoundTrainer
from agents.training.sb3_vector import Sb3VecEnv
from shotenv.config import EnvConfig


class PpoTrainer(RoundTrainer):
    """One run of PPO, or of RecurrentPPO, in the folder `out`.

    Parameters
    ----------
    envs : Sb3VecEnv
        `config.ppo.num_envs` environments.
    frames_per_drive : int
        Length of an episode; a round lasts at least that long.
    config : AgentConfig
        Its `algorithm` is "ppo" or "recurrent_ppo".
    warm : callable, optional
        Trains the actor before the first round, see `agents.training.warmup`.
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
        warm: Callable[[ActorCriticPolicy], None] | None = None,
        env: EnvConfig | None = None,
    ) -> None:
        ppo = config.ppo
        # A round is whole updates, enough of them to see a drive from its first frame to its last.
        updates = math.ceil(frames_per_drive / ppo.rollout_steps)
        super().__init__(
            envs,
            feature_names,
            config,
            validate,
            out,
            round_steps=updates * ppo.rollout_steps * ppo.num_envs,
            total_steps=ppo.total_steps,
            env=env,
        )
        self._warm, self._learning_rate = warm, ppo.learning_rate
        self._known = training_drives(config.seed, ppo.drives)
        form: dict[str, Any] = {"net_arch": list(config.hidden)}
        self._recurrent = config.algorithm == "recurrent_ppo"
        algorithm: Any = PPO
        if self._recurrent:
            algorithm = contrib_learner("RecurrentPPO", config.algorithm)
            form["lstm_hidden_size"] = config.recurrent.units
        self.model = algorithm(
            "MlpLstmPolicy" if self._recurrent else "MlpPolicy",
            envs,
            # stable-baselines3 would let it fall within each `learn`, thus within each round.
            learning_rate=lambda remaining: self._learning_rate,
            n_steps=ppo.rollout_steps,
            batch_size=ppo.batch_size,
            n_epochs=ppo.epochs,
            gamma=ppo.gamma,
            gae_lambda=ppo.gae_lambda,
            ent_coef=ppo.entropy_coefficient,
            policy_kwargs=form,
            seed=config.seed,
            device="cpu",  # two small layers: copying to a GPU would take longer
        )

    @property
    def policy(self) -> Scheduler:
        """The actor as it is now."""
        if self._recurrent:
            return RecurrentPolicy.from_recurrent_ppo(self.model.policy, self._provenance)
        return NetworkPolicy.from_ppo(self.model.policy, self._provenance)

    def begin(self) -> bool:
        """Train the actor before the first round, where that was asked for."""
        if self._warm is None:
            return False
        self._warm(self.model.policy)
        return True

    def drives(self, generator: np.random.Generator) -> list[int]:
        """Some of the training drives."""
        ppo = self._config.ppo
        # No drive twice in a round, unless there are fewer drives than environments.
        few = ppo.drives < ppo.num_envs
        return generator.choice(self._known, ppo.num_envs, replace=few).tolist()

    def learn(self, rounds: int, callback: BaseCallback) -> None:
        """Play and learn for one round, after `rounds` others."""
        # It falls linearly, round by round, to a tenth (assumed).
        self._learning_rate = self._config.ppo.learning_rate * (1.0 - 0.9 * rounds / self.rounds)
        # `learn` counts its steps from 0, and therefore resets the environments first: network and
        # optimiser are all that it keeps from the round before, for memories begin anew with the
        # drives.
        self.model.learn(self.round_steps, callback=callback)
