"""PPO training of a scheduler, or RecurrentPPO: interruptible, resumable, without pickle.

Training runs in rounds of whole drives. A round starts every environment on one of the training
drives, chosen with a random state that derives from the run's seed and the round's number alone;
so what a round does is a function of the network, the optimiser and that number, and a resumed
run equals an uninterrupted one. What an LSTM remembers is of a drive, and begins with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import set_random_seed
from tqdm import tqdm

from agents.config import AgentConfig
from agents.policies import NetworkPolicy, RecurrentPolicy, Scheduler, load_policy
from agents.training.checkpoint import (
    Checkpoint,
    TrainingState,
    Validate,
    provenance_of,
    training_drives,
)
from agents.training.contrib import contrib_learner
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.scalars import Scalars
from shotenv.config import EnvConfig
from unwrap.support import progress


class PpoTrainer:
    """One run of PPO, or of RecurrentPPO, in the folder `out`.

    Parameters
    ----------
    envs : Sb3VecEnv
        `config.ppo.num_envs` environments.
    feature_names : sequence of str
        Of the observation's elements.
    frames_per_drive : int
        Length of an episode; a round lasts at least that long.
    config : AgentConfig
        Hyper-parameters; its `algorithm` is "ppo" or "recurrent_ppo".
    validate : callable
        Mean return of a policy on validation drives; the best round's policy is kept.
    out : Path
        Gets the checkpoint, and the best policy as `policy.safetensors` and `agent.json`.
    warm : callable, optional
        Trains the actor before the first round, see `agents.training.warmup`.
    env : EnvConfig, optional
        Of the environments, which the saved policy tells.

    Raises
    ------
    ValueError
        `out` holds the checkpoint of another configuration, or a damaged one.
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
        self._envs, self._config, self._validate, self._out = envs, config, validate, out
        self._warm = warm
        # A round is whole updates, enough of them to see a drive from its first frame to its last.
        updates = math.ceil(frames_per_drive / ppo.rollout_steps)
        self._round_steps = updates * ppo.rollout_steps * ppo.num_envs
        self._rounds = math.ceil(ppo.total_steps / self._round_steps)
        self._learning_rate = ppo.learning_rate
        form: dict[str, Any] = {"net_arch": list(config.hidden)}
        self._recurrent = config.algorithm == "recurrent_ppo"
        algorithm: Any = PPO
        if self._recurrent:
            algorithm = contrib_learner("RecurrentPPO", config.algorithm)
            form["lstm_hidden_size"] = config.recurrent.units
        self._ppo = algorithm(
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
        self._provenance = provenance_of(config, feature_names, env)
        self._checkpoint = Checkpoint(out, self._provenance)
        self._scalars = Scalars(out if config.tensorboard else None)

    @property
    def policy(self) -> Scheduler:
        """The actor as it is now."""
        if self._recurrent:
            return RecurrentPolicy.from_recurrent_ppo(self._ppo.policy, self._provenance)
        return NetworkPolicy.from_ppo(self._ppo.policy, self._provenance)

    def run(self) -> Scheduler:
        """Train to the end, from the checkpoint where there is one; returns the best policy.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C; the checkpoint of the last finished round is kept.
        """
        config = self._config
        drives = training_drives(config.seed, config.ppo.drives)
        self._out.mkdir(parents=True, exist_ok=True)
        state = self._checkpoint.load(lambda tensors: _restore(self._ppo, tensors))
        if state == TrainingState() and self._warm is not None:
            self._warm(self._ppo.policy)
            state = state.judged(self.policy, self._validate, self._out)
            self._save(state)
        done = state.rounds * self._round_steps
        with progress(self._rounds * self._round_steps, "training", "step", done=done) as bar:
            while state.rounds < self._rounds:
                # All randomness of a round comes from its number, so that a resumed run draws what
                # an uninterrupted one does.
                generator = np.random.default_rng((config.seed, state.rounds))
                set_random_seed(int(generator.integers(2**31)))
                # No drive twice in a round, unless there are fewer drives than environments.
                few = config.ppo.drives < config.ppo.num_envs
                self._envs.seed_all(
                    generator.choice(drives, config.ppo.num_envs, replace=few).tolist()
                )
                # It falls linearly, round by round, to a tenth (assumed).
                self._learning_rate = config.ppo.learning_rate * (
                    1.0 - 0.9 * state.rounds / self._rounds
                )
                # `learn` counts its steps from 0, and therefore resets the environments first:
                # network and optimiser are all that it keeps from the round before, for memories
                # begin anew with the drives. Those that `seed_all` chose begin there.
                self._ppo.learn(self._round_steps, callback=_Ticks(bar))
                state = state.judged(self.policy, self._validate, self._out)
                state = replace(state, rounds=state.rounds + 1)
                bar.set_postfix_str(state.in_words(), refresh=False)
                self._scalars.add(
                    "validation/return", state.last_return, state.rounds * self._round_steps
                )
                self._save(state)
        # From disk: the best round's policy, which need not be the last one's.
        return load_policy(self._out)

    def _save(self, state: TrainingState) -> None:
        self._checkpoint.save(_tensors(self._ppo), state)


class _Ticks(BaseCallback):
    """Moves the progress bar."""

    def __init__(self, bar: tqdm) -> None:
        super().__init__()
        self._bar = bar

    def _on_step(self) -> bool:
        self._bar.update(self.training_env.num_envs)
        return True


def _tensors(ppo: Any) -> dict[str, torch.Tensor]:
    """Network and optimiser as named tensors: a file of them needs no unpickling to be read."""
    network = {f"network.{name}": value for name, value in ppo.policy.state_dict().items()}
    adam = {
        # Adam's step count is a plain number in some versions of torch.
        f"optimizer.{parameter}.{name}": torch.as_tensor(value)
        for parameter, slots in ppo.policy.optimizer.state_dict()["state"].items()
        for name, value in slots.items()
    }
    return {name: value.detach().clone().contiguous() for name, value in (network | adam).items()}


def _restore(ppo: Any, tensors: dict[str, torch.Tensor]) -> None:
    """Inverse of `_tensors`."""
    network: dict[str, torch.Tensor] = {}
    slots: dict[int, dict[str, Any]] = {}
    for name, value in tensors.items():
        kind, rest = name.split(".", 1)
        if kind == "network":
            network[rest] = value
        else:
            parameter, slot = rest.split(".", 1)
            slots.setdefault(int(parameter), {})[slot] = value
    ppo.policy.load_state_dict(network)
    # Names and order of the parameters are the network's; only what Adam remembers is restored.
    optimizer = ppo.policy.optimizer
    optimizer.load_state_dict({**optimizer.state_dict(), "state": slots})
