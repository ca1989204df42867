"""TODO."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from agents.config import AgentConfig
from agents.policies.guard import ThermalGuard
from unwrap.signal import Shots

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy
from agents.policies.policy import Action, Observation, Policy, single

AGENT_SCHEMA: Final = 2


class PpoPolicy(Policy):
    """A stable-baselines3 actor behind a thermal guard; the most probable action is taken.

    Saved as a folder of `policy.safetensors` and `agent.json`; nothing is ever unpickled.
    """

    def __init__(
        self, network: ActorCriticPolicy, config: AgentConfig, guard: ThermalGuard
    ) -> None:
        self.network = network
        self.config = config
        self.guard = guard

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Names of the observation's elements."""
        return self.guard.feature_names

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The most probable action under the network, if the guard allows it."""
        action, _ = self.network.predict(observation, deterministic=True)
        return single(self.guard(observation, np.asarray(action, dtype=np.int64)))

    def save(self, folder: Path) -> None:
        """Write `policy.safetensors`, then `agent.json`, each atomically."""
        from safetensors.torch import save

        from unwrap.support import write_bytes, write_json

        folder.mkdir(parents=True, exist_ok=True)
        tensors = {name: value.contiguous() for name, value in self.network.state_dict().items()}
        write_bytes(folder / "policy.safetensors", save(tensors))
        write_json(folder / "agent.json", self._description())

    def _description(self) -> dict[str, Any]:
        return {
            "schema": AGENT_SCHEMA,
            "agent": self.config.model_dump(mode="json"),
            "feature_names": list(self.feature_names),
            "guard_needed_k": list(self.guard.needed_k),
            "versions": {name: version(name) for name in ("stable-baselines3", "torch")},
        }

    @classmethod
    def load(cls, folder: Path) -> PpoPolicy:
        """Scheduler saved in `folder`.

        Raises
        ------
        ValueError
            The folder holds no scheduler, or a damaged one; the message names the file.
        """
        from safetensors.torch import load_file

        description = _read_description(folder / "agent.json")
        config = AgentConfig.model_validate(description["agent"])
        guard = ThermalGuard(description["feature_names"], description["guard_needed_k"])
        network = build_network(len(guard.feature_names), config)
        weights = folder / "policy.safetensors"
        try:
            network.load_state_dict(load_file(weights))
        except Exception as error:  # safetensors has an error type of its own per fault
            raise ValueError(f"{weights} is not a usable network: {first_line(error)}") from None
        return cls(network, config, guard)


def build_network(features: int, config: AgentConfig) -> ActorCriticPolicy:
    """Untrained actor and critic of `config` for an observation of `features` elements."""
    from gymnasium.spaces import Box, Discrete
    from stable_baselines3.common.policies import ActorCriticPolicy

    observed = Box(-np.inf, np.inf, (features,), np.float32)
    network = ActorCriticPolicy(
        observed, Discrete(len(Shots)), lambda _: config.learning_rate, **network_arguments(config)
    )
    network.set_training_mode(False)
    return network


def network_arguments(config: AgentConfig) -> dict[str, Any]:
    """What PPO and `build_network` both need to make the same network."""
    return {"net_arch": list(config.hidden)}


def _read_description(path: Path) -> dict[str, Any]:
    try:
        description = json.loads(path.read_text(encoding="utf-8"))
        found = description["schema"]
    except FileNotFoundError:
        raise ValueError(
            f"{path.parent} holds no scheduler ({path.name} is missing); "
            "`shotenv train --out DIR` makes one"
        ) from None
    except (UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError):
        raise ValueError(f"{path} is damaged; expected the description of a scheduler") from None
    if found != AGENT_SCHEMA:
        raise ValueError(f"{path} has schema {found!r}; this version reads {AGENT_SCHEMA}")
    return description


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
