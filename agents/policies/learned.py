"""Schedulers that were trained, and the folders that they are saved in."""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import numpy as np
import torch
from pydantic import Field, ValidationError
from torch import nn

from agents.policies.policy import Action, Observation, Policy, single
from agents.policies.score_networks import (
    Activation,
    activation_of,
    actor_network,
    in_blocks,
    mean_quantile_network,
    q_network,
    require_widths,
    score_network,
    widths_of,
)
from unwrap.support import Range, Section, write_bytes, write_json

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.dqn.policies import QNetwork

AGENT_SCHEMA: Final = 5
WEIGHTS: Final = "policy.safetensors"
DESCRIPTION: Final = "agent.json"
PACKAGES: Final = ("shotenv", "torch", "stable-baselines3", "sb3-contrib")
# Assumed: a damaged or hostile description must not make a network that fills the memory.
WIDEST, DEEPEST = 1024, 16


def installed_versions() -> dict[str, str]:
    """Versions of the packages that train schedulers, as far as they are installed."""
    found = {}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


class Provenance(Section):
    """How a scheduler came about; nothing of it is needed to use it, but for the names.

    Attributes
    ----------
    algorithm : str
        As "ppo", "dqn", "qrdqn", "regression".
    feature_names : tuple of str
        Elements of the observation, in order.
    power_price : (float, float), optional
        Lowest and highest weight of power (`reward.power`) that it was trained with.
    training : dict
        Configuration of the training.
    environment : dict
        Configuration of the environment that it was trained in; empty where it is not known.
    seed : int
        Of the training.
    versions : dict of str to str
        Of the packages that it was trained with.
    """

    algorithm: str
    feature_names: tuple[str, ...]
    power_price: Range | None = None
    training: dict[str, Any] = Field(default_factory=dict)
    environment: dict[str, Any] = Field(default_factory=dict)
    seed: int = 0
    versions: dict[str, str] = Field(default_factory=installed_versions)


class Description(Section):
    """What `agent.json` holds beside its schema: `Provenance`, and the network's form.

    Attributes
    ----------
    layers : tuple of int
        Widths: features, hidden layers, actions.
    activation : {"tanh", "relu"}
    """

    algorithm: str
    feature_names: tuple[str, ...]
    layers: tuple[Annotated[int, Field(ge=1, le=WIDEST)], ...] = Field(
        min_length=2, max_length=DEEPEST
    )
    activation: Activation
    power_price: Range | None
    training: dict[str, Any]
    environment: dict[str, Any] = Field(default_factory=dict)  # older files have none
    seed: int
    versions: dict[str, str]


class NetworkPolicy(Policy):
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
    ValueError
        `network` has another form, or other widths than the features and actions.

    Examples
    --------
    >>> network = torch.nn.Sequential(torch.nn.Linear(1, 3))
    >>> policy = NetworkPolicy(network, Provenance(algorithm="none", feature_names=("power",)))
    >>> policy.scores(np.zeros((2, 1), np.float32)).shape
    (2, 3)
    """

    reads_price = True  # among its features

    def __init__(self, network: nn.Sequential, provenance: Provenance) -> None:
        self.activation = activation_of(network)
        require_widths(network, provenance.feature_names)
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
        told = observation["state"] if isinstance(observation, Mapping) else observation
        features = torch.as_tensor(np.asarray(told, dtype=np.float32))
        expected = len(self.feature_names)
        if features.shape[-1:] != (expected,):
            raise ValueError(
                f"observation has shape {tuple(features.shape)}; expected {expected} features: "
                + ", ".join(self.feature_names)
            )
        with torch.inference_mode():
            found = self._runs(features.reshape(-1, expected))
        return found.reshape(*features.shape[:-1], -1).numpy()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The action of the highest score, the first of equal ones."""
        return single(self.scores(observation).argmax(axis=-1))

    def save(self, folder: Path) -> None:
        """Write `policy.safetensors`, then `agent.json`, each atomically."""
        from safetensors.torch import save

        description = Description(
            **self.provenance.model_dump(),
            layers=widths_of(self.network),
            activation=self.activation,
        )
        # safetensors refuses tensors that do not lie in one piece.
        tensors = {name: value.contiguous() for name, value in self.network.state_dict().items()}
        # The description comes last: a folder that has it has the weights, too.
        write_bytes(folder / WEIGHTS, save(tensors))
        write_json(
            folder / DESCRIPTION, {"schema": AGENT_SCHEMA, **description.model_dump(mode="json")}
        )

    @classmethod
    def load(cls, folder: Path) -> NetworkPolicy:
        """Scheduler saved in `folder`.

        Raises
        ------
        ValueError
            The folder holds no scheduler, one of another version, or a damaged one; the message
            names the file.
        """
        from safetensors.torch import load_file

        told = read_description(folder / DESCRIPTION)
        network, weights = score_network(told.layers, told.activation), folder / WEIGHTS
        try:
            network.load_state_dict(load_file(weights))
        except Exception as error:  # safetensors has an error type of its own per fault
            raise ValueError(f"{weights} is not a usable network: {first_line(error)}") from None
        if not all(value.isfinite().all() for value in network.parameters()):
            raise ValueError(f"{weights} is not a usable network: not all weights are finite")
        known = told.model_dump(include=set(Provenance.model_fields))
        try:
            return cls(network, Provenance(**known))
        except ValueError as error:
            raise ValueError(f"{folder / DESCRIPTION}: layers: {error}") from None


def read_description(path: Path) -> Description:
    """What an `agent.json` says.

    Raises
    ------
    ValueError
        It is missing, damaged, of another schema, or has a field that is missing, unknown or of no
        use; the message names the file, and the field.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        # Looked at before the fields: those of another version may have other names.
        schema = content.pop("schema")
    except (FileNotFoundError, NotADirectoryError):
        raise ValueError(
            f"{path.parent} holds no scheduler ({path.name} is missing); "
            "`shotenv train --out DIR` makes one"
        ) from None
    # The last three: JSON that is no table, or a table without a schema.
    except (UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, AttributeError):
        raise ValueError(f"{path} is damaged; expected the description of a scheduler") from None
    if schema != AGENT_SCHEMA:
        raise ValueError(
            f"{path} has schema {schema!r}, but this version reads {AGENT_SCHEMA}; "
            "train the scheduler again (`shotenv train --out DIR`)"
        )
    try:
        return Description.model_validate(content)
    except ValidationError as error:
        fault = error.errors()[0]
        field = ".".join(map(str, fault["loc"]))
        got = "" if fault["type"] == "missing" else f", got {fault['input']!r}"
        raise ValueError(
            f"{path}: {field}: {fault['msg'].lower()}{got}; expected what `shotenv train` writes"
        ) from None


def first_line(error: Exception) -> str:
    """The first line of an error's message."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def load_policy(folder: str | Path) -> NetworkPolicy:
    """The policy that `shotenv train` saved in `folder`.

    Raises
    ------
    ValueError
        What `NetworkPolicy.load` refuses; the message names the file.
    """
    return NetworkPolicy.load(Path(folder))
