"""Learners of stable-baselines3 in rounds of whole drives: interruptible, resumable, no pickle.

A round starts every environment on a drive that was chosen with a random state which derives from
the run's seed and the round's number alone; so what a round does is a function of what the
checkpoint holds and of that number, and a resumed run equals an uninterrupted one.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from agents.config import AgentConfig
from agents.policies import Scheduler, load_policy
from agents.training.checkpoint import Checkpoint, TrainingState, Validate, provenance_of
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.scalars import Scalars
from shotenv.config import EnvConfig
from unwrap.support import progress


class RoundTrainer(ABC):
    """One run of a learner of stable-baselines3 in the folder `out`.

    Parameters
    ----------
    envs : Sb3VecEnv
        Environments in which it plays.
    feature_names : sequence of str
        Of the observation's elements.
    config : AgentConfig
        Which learner, and its hyper-parameters.
    validate : callable
        Mean return of a policy on validation drives; the best round's policy is kept.
    out : Path
        Gets the checkpoint, and the best policy as `policy.safetensors` and `agent.json`.
    round_steps, total_steps : int
        Steps of all environments in a round, and in the run, which is whole rounds.
    env : EnvConfig, optional
        Of the environments, which the saved policy tells.

    Raises
    ------
    ValueError
        `out` holds the checkpoint of another configuration, or a damaged one.
    """

    model: Any

    def __init__(
        self,
        envs: Sb3VecEnv,
        feature_names: Sequence[str],
        config: AgentConfig,
        validate: Validate,
        out: Path,
        *,
        round_steps: int,
        total_steps: int,
        env: EnvConfig | None,
    ) -> None:
        self._envs, self._config, self._validate, self._out = envs, config, validate, out
        self.round_steps, self.rounds = round_steps, math.ceil(total_steps / round_steps)
        self._provenance = provenance_of(config, feature_names, env)
        self._checkpoint = Checkpoint(out, self._provenance)
        self._scalars = Scalars(out if config.tensorboard else None)

    @property
    @abstractmethod
    def policy(self) -> Scheduler:
        """The policy as it is now."""

    @abstractmethod
    def drives(self, generator: np.random.Generator) -> Sequence[int]:
        """Seeds of the drives on which the environments start a round."""

    @abstractmethod
    def learn(self, rounds: int, callback: BaseCallback) -> None:
        """Play and learn for one round, after `rounds` others."""

    def begin(self) -> bool:
        """Do what comes before the first round; whether there is such a thing."""
        return False

    def memory(self, rounds: int) -> dict[str, torch.Tensor]:
        """What a checkpoint holds after so many rounds, besides network and optimiser."""
        return {}

    def remember(self, memory: dict[str, torch.Tensor]) -> None:  # noqa: B027
        """Inverse of `memory`; most learners have none."""

    def run(self) -> Scheduler:
        """Train to the end, from the checkpoint where there is one; returns the best policy.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C; the checkpoint of the last finished round is kept.
        """
        self._out.mkdir(parents=True, exist_ok=True)
        state = self._checkpoint.load(self._restore)
        if state == TrainingState() and self.begin():
            state = state.judged(self.policy, self._validate, self._out)
            self._save(state)
        done, steps = state.rounds * self.round_steps, self.rounds * self.round_steps
        with progress(steps, "training", "step", done=done) as bar:
            while state.rounds < self.rounds:
                # All randomness of a round comes from its number, so that a resumed run draws what
                # an uninterrupted one does.
                generator = np.random.default_rng((self._config.seed, state.rounds))
                self.model.set_random_seed(int(generator.integers(2**31)))
                self._envs.seed_all(self.drives(generator))
                self.learn(state.rounds, _Ticks(bar))
                state = state.judged(self.policy, self._validate, self._out)
                state = replace(state, rounds=state.rounds + 1)
                bar.set_postfix_str(state.in_words(), refresh=False)
                self._scalars.add(
                    "validation/return", state.last_return, state.rounds * self.round_steps
                )
                self._save(state)
        # From disk: the best round's policy, which need not be the last one's.
        return load_policy(self._out)

    def _save(self, state: TrainingState) -> None:
        self._checkpoint.save(_tensors(self.model) | self.memory(state.rounds), state)

    def _restore(self, tensors: dict[str, torch.Tensor]) -> None:
        self.remember(_restore(self.model, tensors))


class _Ticks(BaseCallback):
    """Moves the progress bar."""

    def __init__(self, bar: tqdm) -> None:
        super().__init__()
        self._bar = bar

    def _on_step(self) -> bool:
        self._bar.update(self.training_env.num_envs)
        return True


def _tensors(model: Any) -> dict[str, torch.Tensor]:
    """Network and optimiser as named tensors: a file of them needs no unpickling to be read."""
    network = {f"network.{name}": value for name, value in model.policy.state_dict().items()}
    adam = {
        # Adam's step count is a plain number in some versions of torch.
        f"optimizer.{parameter}.{name}": torch.as_tensor(value)
        for parameter, slots in model.policy.optimizer.state_dict()["state"].items()
        for name, value in slots.items()
    }
    return {name: value.detach().clone().contiguous() for name, value in (network | adam).items()}


def _restore(model: Any, tensors: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Inverse of `_tensors`; returns what is neither the network's nor the optimiser's."""
    network: dict[str, torch.Tensor] = {}
    slots: dict[int, dict[str, Any]] = {}
    others: dict[str, torch.Tensor] = {}
    for name, value in tensors.items():
        kind, rest = name.split(".", 1)
        if kind == "network":
            network[rest] = value
        elif kind == "optimizer":
            parameter, slot = rest.split(".", 1)
            slots.setdefault(int(parameter), {})[slot] = value
        else:
            others[name] = value
    model.policy.load_state_dict(network)
    # Names and order of the parameters are the network's; only what Adam remembers is restored.
    optimizer = model.policy.optimizer
    optimizer.load_state_dict({**optimizer.state_dict(), "state": slots})
    return others
