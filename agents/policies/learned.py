"""Schedulers that were trained, and the folders that they are saved in."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import nn

from agents.policies.foreign_zips import network_of_zip
from agents.policies.policy import Observation, ScoringPolicy
from agents.policies.recurrent import RecurrentPolicy
from agents.policies.scheduler_files import (
    DESCRIPTION,
    Description,
    Provenance,
    read_description,
    read_weights,
    write_scheduler,
)
from agents.policies.score_networks import (
    activation_of,
    actor_network,
    features_of,
    in_blocks,
    mean_quantile_network,
    q_network,
    require_widths,
    score_network,
    widths_of,
)
from shotenv.decision import FEATURE_NAMES
from unwrap.support import require_path

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.dqn.policies import QNetwork


class NetworkPolicy(ScoringPolicy):
    """A feed-forward network that scores each action; the highest score wins.

    Saved as a folder of `policy.safetensors` and `agent.json`; nothing is ever unpickled, and
    loading needs torch, not what trained it.

    Parameters
    ----------
    network : nn.Sequential
        Linear layers with tanh or relu between, from features [N, D] to scores [N, 3]; copied.
    provenance : Provenance

    Raises
    ------
    TypeError, ValueError
        `network` has another form, or other widths than the features and actions; `provenance` is
        none.

    Examples
    --------
    >>> network = torch.nn.Sequential(torch.nn.Linear(1, 3))
    >>> policy = NetworkPolicy(network, Provenance(algorithm="none", feature_names=("power",)))
    >>> policy.scores(np.zeros((2, 1), np.float32)).shape
    (2, 3)
    """

    def __init__(self, network: nn.Sequential, provenance: Provenance) -> None:
        if not isinstance(provenance, Provenance):
            raise TypeError(f"provenance is {type(provenance).__name__}; expected a Provenance")
        self.activation = activation_of(network)
        require_widths(network, len(provenance.feature_names))
        self.network = copy.deepcopy(network).requires_grad_(False).eval()
        # What is run: of a mean of networks each for itself.
        self._runs = in_blocks(self.network)
        self.provenance = provenance

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Elements of the observation, in order."""
        return self.provenance.feature_names

    @classmethod
    def from_ppo(cls, policy: ActorCriticPolicy, provenance: Provenance) -> NetworkPolicy:
        """The actor of stable-baselines3's PPO (`model.policy`): its most probable action."""
        return cls(actor_network(policy), provenance)

    @classmethod
    def from_dqn(cls, network: QNetwork, provenance: Provenance) -> NetworkPolicy:
        """The values of stable-baselines3's DQN (`model.q_net`)."""
        return cls(q_network(network), provenance)

    @classmethod
    def from_qr_dqn(cls, network: Any, provenance: Provenance) -> NetworkPolicy:
        """The mean quantile of sb3-contrib's QR-DQN (`model.quantile_net`)."""
        return cls(mean_quantile_network(network), provenance)

    def scores(self, observation: Observation) -> np.ndarray:
        """Score of each action, float32 [..., 3], for features [..., D].

        Raises
        ------
        ValueError
            The observation has another number of features.
        """
        features = features_of(observation, self.feature_names)
        with torch.inference_mode():
            found = self._runs(features.reshape(-1, features.shape[-1]))
        return found.reshape(*features.shape[:-1], -1).numpy()

    def save(self, folder: Path) -> None:
        """Write `policy.safetensors`, then `agent.json`, each atomically."""
        description = Description(
            **self.provenance.model_dump(),
            layers=widths_of(self.network),
            activation=self.activation,
        )
        write_scheduler(folder, self.network, description)

    @classmethod
    def load(cls, folder: Path) -> NetworkPolicy:
        """Scheduler saved in `folder`.

        Raises
        ------
        ValueError
            The folder holds no scheduler, one of another version, or a damaged one; the message
            names the file.
        """
        told = read_description(folder / DESCRIPTION)
        if told.memory:
            raise ValueError(
                f"{folder / DESCRIPTION}: memory: it has an LSTM of {told.memory} units; expected "
                "a network of the features alone"
            )
        network = score_network(told.layers, told.activation)
        read_weights(folder, network)
        try:
            return cls(network, told.provenance)
        except ValueError as error:
            raise ValueError(f"{folder / DESCRIPTION}: layers: {error}") from None


Scheduler = NetworkPolicy | RecurrentPolicy
"""What `shotenv train` makes."""


def load_policy(path: str | Path, *, trust: bool = False) -> Scheduler:
    """The policy that `shotenv train` saved in the folder `path`, or a zip of stable-baselines3.

    Parameters
    ----------
    trust : bool
        Whether a zip may be read. Nothing in it is run: its weights are read as tensors, and the
        rest, which is pickled, is not. But it does not tell which features it was trained on, nor
        in what environment.

    Raises
    ------
    ValueError
        The folder holds no scheduler, one of another version, or a damaged one; the path is a zip
        that is not trusted, or not of PPO, A2C, DQN or QR-DQN on the features of this environment.
        The message names the file.
    """
    require_path(path=path)
    path = Path(path)
    if path.is_file():
        return _load_zip(path, trust=trust)
    kind = RecurrentPolicy if read_description(path / DESCRIPTION).memory else NetworkPolicy
    return kind.load(path)


def _load_zip(path: Path, *, trust: bool) -> NetworkPolicy:
    if not trust:
        raise ValueError(
            f"{path} is a file; expected the folder of a scheduler. A zip of stable-baselines3 "
            "holds pickles, which run whatever code they name when stable-baselines3 loads them, "
            "and does not tell which features it was trained on. `--trust` takes it: its weights "
            "alone are read, without running anything, as those of a network of the features here"
        )
    network, kind = network_of_zip(path)
    # None of what else it tells can be checked; of its prices and versions it does not tell.
    told = Provenance(algorithm=f"{kind}, {path.name}", feature_names=FEATURE_NAMES, versions={})
    try:
        return NetworkPolicy(network, told)
    except ValueError as error:
        raise ValueError(
            f"{path} is of another environment: {error}, which are {', '.join(FEATURE_NAMES)}"
        ) from None
