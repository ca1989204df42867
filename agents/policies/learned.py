"""Schedulers that were trained, and the folders that they are saved in."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from pydantic import ValidationError

from agents.config import AgentConfig
from agents.policies.policy import Action, Observation, Policy, single
from unwrap.signal import Shots
from unwrap.support import Section, write_bytes, write_json

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

AGENT_SCHEMA: Final = 4
WEIGHTS: Final = "policy.safetensors"
DESCRIPTION: Final = "agent.json"


class Description(Section):
    """What `agent.json` holds beside its schema.

    Attributes
    ----------
    agent : AgentConfig
        How the scheduler was trained; its network is built anew from that.
    feature_names : tuple of str
        Elements of the observation, in order.
    versions : dict of str to str
        Of the packages that it was trained with.
    """

    agent: AgentConfig
    feature_names: tuple[str, ...]
    versions: dict[str, str]


class PpoPolicy(Policy):
    """A stable-baselines3 actor; the most probable action is taken.

    Saved as a folder of `policy.safetensors` and `agent.json`; nothing is ever unpickled.
    """

    def __init__(
        self, network: ActorCriticPolicy, config: AgentConfig, feature_names: Sequence[str]
    ) -> None:
        self.network = network
        self.config = config
        self.feature_names = tuple(feature_names)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The most probable action under the network."""
        action, _ = self.network.predict(observation, deterministic=True)
        return single(np.asarray(action, dtype=np.int64))

    def save(self, folder: Path) -> None:
        """Write `policy.safetensors`, then `agent.json`, each atomically."""
        from safetensors.torch import save

        description = Description(
            agent=self.config,
            feature_names=self.feature_names,
            versions={name: version(name) for name in ("stable-baselines3", "torch")},
        )
        # safetensors refuses tensors that do not lie in one piece.
        tensors = {name: value.contiguous() for name, value in self.network.state_dict().items()}
        # The description comes last: a folder that has it has the weights, too.
        write_bytes(folder / WEIGHTS, save(tensors))
        write_json(
            folder / DESCRIPTION, {"schema": AGENT_SCHEMA, **description.model_dump(mode="json")}
        )

    @classmethod
    def load(cls, folder: Path) -> PpoPolicy:
        """Scheduler saved in `folder`.

        Raises
        ------
        ValueError
            The folder holds no scheduler, one of another version, or a damaged one; the message
            names the file.
        """
        from safetensors.torch import load_file

        description = read_description(folder / DESCRIPTION)
        network = build_network(len(description.feature_names), description.agent)
        weights = folder / WEIGHTS
        try:
            network.load_state_dict(load_file(weights))
        except Exception as error:  # safetensors has an error type of its own per fault
            raise ValueError(f"{weights} is not a usable network: {first_line(error)}") from None
        return cls(network, description.agent, description.feature_names)


def build_network(features: int, config: AgentConfig) -> ActorCriticPolicy:
    """Untrained actor and critic of `config` for an observation of `features` elements."""
    from gymnasium.spaces import Box, Discrete
    from stable_baselines3.common.policies import ActorCriticPolicy

    observed = Box(-np.inf, np.inf, (features,), np.float32)
    network = ActorCriticPolicy(
        # The rate serves the optimiser, which the class makes in any case and nothing here uses.
        observed,
        Discrete(len(Shots)),
        lambda _: config.learning_rate,
        **network_arguments(config),
    )
    network.set_training_mode(False)
    return network


def network_arguments(config: AgentConfig) -> dict[str, Any]:
    """Arguments of stable-baselines3's actor and critic, for PPO and `build_network` alike."""
    return {"net_arch": list(config.hidden)}


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
    except FileNotFoundError:
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


def load_policy(folder: str | Path) -> PpoPolicy:
    """The policy that `shotenv train` saved in `folder`.

    Raises
    ------
    ValueError
        What `PpoPolicy.load` refuses; the message names the file.
    """
    return PpoPolicy.load(Path(folder))
