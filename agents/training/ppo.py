"""PPO training of a scheduler: interruptible, resumable, without pickle.

Training runs in rounds of whole drives. A round starts every environment on one of the training
drives, chosen with a random state that derives from the run's seed and the round's number alone;
so what a round does is a function of the network, the optimiser and that number, and a resumed
run equals an uninterrupted one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.utils import set_random_seed
from tqdm import tqdm

from agents.config import AgentConfig
from agents.policies import NetworkPolicy, Provenance, first_line
from agents.training.sb3_vector import Sb3VecEnv
from unwrap.support import Range, progress, write_bytes

# One file, replaced whole: network, optimiser and progress of the same round, or none of them.
CHECKPOINT: Final = "checkpoint.safetensors"
SCHEMA: Final = "1"
Validate = Callable[[NetworkPolicy], float]


@dataclass(frozen=True)
class TrainingState:
    """How far a run has come.

    Attributes
    ----------
    rounds : int
        Finished rounds.
    best_return : float
        Best return on validation drives so far.
    best_round : int
        Finished rounds when it was found; -1 before the first validation.
    """

    rounds: int = 0
    best_return: float = -math.inf
    best_round: int = -1


class Trainer:
    """One PPO run in the folder `out`.

    Parameters
    ----------
    envs : Sb3VecEnv
        `config.num_envs` environments.
    feature_names : sequence of str
        Of the observation's elements.
    frames_per_drive : int
        Length of an episode; a round lasts at least that long.
    config : AgentConfig
        Hyper-parameters.
    validate : callable
        Mean return of a policy on validation drives; the best round's policy is kept.
    out : Path
        Gets the checkpoint, and the best policy as `policy.safetensors` and `agent.json`.
    warm : callable, optional
        Trains the actor before the first round, see `agents.training.warmup`.
    power_price : (float, float), optional
        Range of the weight of power in the drives, which the saved policy tells.

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
        power_price: Range | None = None,
    ) -> None:
        self._envs, self._config, self._validate, self._out = envs, config, validate, out
        self._warm = warm
        # A round is whole updates, enough of them to see a drive from its first frame to its last.
        updates = math.ceil(frames_per_drive / config.rollout_steps)
        self._round_steps = updates * config.rollout_steps * config.num_envs
        self._rounds = math.ceil(config.total_steps / self._round_steps)
        self._learning_rate = config.learning_rate
        self._ppo = PPO(
            "MlpPolicy",
            envs,
            # stable-baselines3 would let it fall within each `learn`, thus within each round.
            learning_rate=lambda remaining: self._learning_rate,
            n_steps=config.rollout_steps,
            batch_size=config.batch_size,
            n_epochs=config.epochs,
            gamma=config.gamma,
            gae_lambda=config.gae_lambda,
            ent_coef=config.entropy_coefficient,
            policy_kwargs={"net_arch": list(config.hidden)},
            seed=config.seed,
            device="cpu",  # two small layers: copying to a GPU would take longer
        )
        self._provenance = Provenance(
            algorithm="ppo",
            feature_names=tuple(feature_names),
            power_price=power_price,
            training=config.model_dump(mode="json"),
            seed=config.seed,
        )
        # What a checkpoint must have been made with to be continued here.
        self._identity = json.dumps(
            {
                "agent": config.model_dump(mode="json"),
                "features": list(feature_names),
            }
        )

    @property
    def policy(self) -> NetworkPolicy:
        """The actor as it is now."""
        return NetworkPolicy.from_ppo(self._ppo.policy, self._provenance)

    def run(self) -> NetworkPolicy:
        """Train to the end, from the checkpoint where there is one; returns the best policy.

        Raises
        ------
        KeyboardInterrupt
            Ctrl-C; the checkpoint of the last finished round is kept.
        """
        config, drives = self._config, training_drives(self._config)
        self._out.mkdir(parents=True, exist_ok=True)
        state = self._load()
        if state == TrainingState() and self._warm is not None:
            self._warm(self._ppo.policy)
            state = self._judged(state)
            self._save(state)
        done = state.rounds * self._round_steps
        with progress(self._rounds * self._round_steps, "training", "step", done=done) as bar:
            while state.rounds < self._rounds:
                # All randomness of a round comes from its number, so that a resumed run draws what
                # an uninterrupted one does.
                generator = np.random.default_rng((config.seed, state.rounds))
                set_random_seed(int(generator.integers(2**31)))
                # No drive twice in a round, unless there are fewer drives than environments.
                few = config.drives < config.num_envs
                self._envs.seed_all(generator.choice(drives, config.num_envs, replace=few).tolist())
                # It falls linearly, round by round, to a tenth (assumed).
                self._learning_rate = config.learning_rate * (
                    1.0 - 0.9 * state.rounds / self._rounds
                )
                # `learn` counts its steps from 0, and therefore resets the environments first:
                # network and optimiser are all that it keeps from the round before. The drives
                # that `seed_all` chose begin there.
                self._ppo.learn(self._round_steps, callback=_Ticks(bar))
                state = replace(self._judged(state), rounds=state.rounds + 1)
                bar.set_postfix_str(f"validation return {state.best_return:.1f}", refresh=False)
                self._save(state)
        # From disk: the best round's policy, which need not be the last one's.
        return NetworkPolicy.load(self._out)

    def _judged(self, state: TrainingState) -> TrainingState:
        """`state` with the return of the policy as it is, which is kept where it is the best."""
        policy = self.policy
        found = self._validate(policy)
        if found <= state.best_return:
            return state
        policy.save(self._out)
        return replace(state, best_return=found, best_round=state.rounds)

    def _save(self, state: TrainingState) -> None:
        words = {"schema": SCHEMA, "identity": self._identity, "progress": json.dumps(vars(state))}
        write_bytes(self._out / CHECKPOINT, save(_tensors(self._ppo), words))

    def _load(self) -> TrainingState:
        path = self._out / CHECKPOINT
        if not path.exists():
            return TrainingState()
        try:
            with safe_open(path, framework="pt") as file:
                words = dict(file.metadata() or {})
                tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            same = (words["schema"], words["identity"]) == (SCHEMA, self._identity)
            # Tensors of another configuration may not fit, which would read as damage.
            if same:
                _restore(self._ppo, tensors)
            state = TrainingState(**json.loads(words["progress"]))
        except (SafetensorError, OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
            raise ValueError(
                f"{path} is damaged ({first_line(error)}); delete it to start anew"
            ) from None
        if not same:
            raise ValueError(
                f"{path} belongs to another configuration; choose another folder or delete it"
            )
        return state


def training_drives(config: AgentConfig) -> np.ndarray:
    """Seeds of the drives that a scheduler is trained on."""
    return np.random.SeedSequence(config.seed).generate_state(config.drives)


class _Ticks(BaseCallback):
    """Moves the progress bar."""

    def __init__(self, bar: tqdm) -> None:
        super().__init__()
        self._bar = bar

    def _on_step(self) -> bool:
        self._bar.update(self.training_env.num_envs)
        return True


def _tensors(ppo: PPO) -> dict[str, torch.Tensor]:
    """Network and optimiser as named tensors: a file of them needs no unpickling to be read."""
    network = {f"network.{name}": value for name, value in ppo.policy.state_dict().items()}
    adam = {
        # Adam's step count is a plain number in some versions of torch.
        f"optimizer.{parameter}.{name}": torch.as_tensor(value)
        for parameter, slots in ppo.policy.optimizer.state_dict()["state"].items()
        for name, value in slots.items()
    }
    return {name: value.detach().clone().contiguous() for name, value in (network | adam).items()}


def _restore(ppo: PPO, tensors: dict[str, torch.Tensor]) -> None:
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
