"""DQN and QR-DQN training of a scheduler; the best policy on validation drives is kept.

A run can be interrupted, but not resumed: it would need the memory of all the steps that it learns
from, which is far larger than what is learnt.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from stable_baselines3 import DQN
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from agents.config import AgentConfig
from agents.policies import NetworkPolicy
from agents.training.checkpoint import TrainingState, Validate, provenance_of
from agents.training.contrib import contrib_learner
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.scalars import Scalars
from shotenv.config import EnvConfig
from unwrap.support import progress


class QLearner:
    """One run of DQN, or of QR-DQN, in the folder `out`.

    Parameters
    ----------
    envs : Sb3VecEnv
        `config.dqn.num_envs` environments.
    feature_names : sequence of str
        Of the observation's elements.
    config : AgentConfig
        Its `algorithm` is "dqn" or "qrdqn".
    validate : callable
        Mean return of a policy on validation drives.
    out : Path
        Gets the best policy as `policy.safetensors` and `agent.json`.
    env : EnvConfig, optional
        Of the environments, which the saved policy tells.
    """

    def __init__(
        self,
        envs: Sb3VecEnv,
        feature_names: Sequence[str],
        config: AgentConfig,
        validate: Validate,
        out: Path,
        env: EnvConfig | None = None,
    ) -> None:
        learner = config.dqn
        self._config, self._validate, self._out = config, validate, out
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
            exploration_fraction=learner.exploration,
            exploration_final_eps=learner.epsilon,
            policy_kwargs=form,
            seed=config.seed,
            device="cpu",  # two small layers: copying to a GPU would take longer
        )
        self._provenance = provenance_of(config, feature_names, env)
        self._scalars = Scalars(out if config.tensorboard else None)

    @property
    def policy(self) -> NetworkPolicy:
        """The network as it is now."""
        if self._quantiles:
            return NetworkPolicy.from_qr_dqn(self.model.quantile_net, self._provenance)
        return NetworkPolicy.from_dqn(self.model.q_net, self._provenance)

    def run(self) -> NetworkPolicy:
        """Train from the start to the end; returns the best policy.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C; its words tell that the best policy so far is kept, and that a run starts over.
        """
        learner = self._config.dqn
        with progress(learner.total_steps, "training", "step") as bar:
            judge = _Judge(bar, self, math.ceil(learner.total_steps / learner.validations))
            try:
                self.model.learn(learner.total_steps, callback=judge)
            except KeyboardInterrupt:
                kept = f"the best scheduler so far is in {self._out}, " if judge.any else ""
                raise KeyboardInterrupt(
                    f"{kept}the memory of {self._config.algorithm} is not kept: "
                    "the same command starts over"
                ) from None
        # From disk: the best policy, which need not be the last one.
        return NetworkPolicy.load(self._out)

    def judged(self, state: TrainingState, step: int) -> TrainingState:
        """`state` with the return of the policy after `step` steps, kept where it is the best."""
        state = state.judged(self.policy, self._validate, self._out)
        self._scalars.add("validation/return", state.last_return, step)
        return state


class _Judge(BaseCallback):
    """Moves the progress bar, and judges the policy every `interval` steps."""

    def __init__(self, bar: tqdm, learner: QLearner, interval: int) -> None:
        super().__init__()
        self._bar, self._learner, self._interval = bar, learner, interval
        self._state, self._next = TrainingState(), interval

    @property
    def any(self) -> bool:
        """Whether a policy has been kept."""
        return math.isfinite(self._state.best_return)

    def _on_step(self) -> bool:
        self._bar.update(self.training_env.num_envs)
        if self.num_timesteps >= self._next:
            self._next += self._interval
            self._judge()
        return True

    def _on_training_end(self) -> None:
        # The last steps may not have filled an interval.
        if self.num_timesteps > self._next - self._interval:
            self._judge()

    def _judge(self) -> None:
        self._state = self._learner.judged(self._state, self.num_timesteps)
        self._bar.set_postfix_str(self._state.in_words(), refresh=False)
