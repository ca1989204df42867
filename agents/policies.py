"""Policies: what chooses the shots of a frame from the observation.

Every policy answers for one environment (observation [D], an int) and for a batch of them
(observation [N, D], int64 [N]) alike, and starts anew at `reset`.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from agents.guard import ThermalGuard
from shotenv.config import AgentConfig
from shotenv.observe import feature_index
from unwrap.acquisition import Shots

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

Action = Any
Observation = Any
SNR_FEATURE: Final = "signal_to_noise"
AGENT_SCHEMA: Final = 2


class Policy(ABC):
    """Chooses an action, 0 = 2 DCS, 1 = 4 DCS, 2 = 8 DCS, from what is observed."""

    @abstractmethod
    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Action of one environment, or int64 [N] of a batch of N."""

    def reset(self) -> None:  # noqa: B027 - most policies remember nothing
        """Forget everything: the next `act` is the first of new drives."""


class FixedPolicy(Policy):
    """Always the same shots.

    Examples
    --------
    >>> FixedPolicy(4).act(np.zeros(3))
    1
    """

    def __init__(self, shots: int) -> None:
        self.action = checked_shots(shots).action

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The same action, whatever is observed."""
        return like(observation, self.action)


class RandomPolicy(Policy):
    """Each action with the same probability."""

    def __init__(self, seed: int = 0) -> None:
        self._seed = seed
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """A fresh draw for each environment."""
        return single(self._generator.integers(len(Shots), size=batch_shape(observation)))

    def reset(self) -> None:
        """Draw the same numbers again."""
        self._generator = np.random.default_rng(self._seed)


class CyclePolicy(Policy):
    """`shots` in every `period`-th frame, starting with the first, and `otherwise` between."""

    def __init__(self, period: int, shots: int = 8, otherwise: int = 2) -> None:
        if period < 2:
            raise ValueError(f"period is {period}; expected at least 2 frames")
        self._period = period
        self._actions = checked_shots(shots).action, checked_shots(otherwise).action
        self.reset()

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The action that the frame's place in the cycle asks for."""
        action = self._actions[self._frame % self._period != 0]
        self._frame += 1
        return like(observation, action)

    def reset(self) -> None:
        """Start the cycle at its first frame."""
        self._frame = 0


class SnrThresholdPolicy(Policy):
    """One threshold on the signal-to-noise ratio of the last acquisition.

    Parameters
    ----------
    feature_names : sequence of str
        `env.unwrapped.feature_names`, to find the ratio in the observation.
    threshold : float
        Compared with the feature as observed, that is after the environment's scaling.
    below, above : int
        Shots where the ratio is below, and at or above, the threshold.
    """

    def __init__(
        self, feature_names: Sequence[str], threshold: float, below: int, above: int
    ) -> None:
        self._index = feature_index(feature_names, SNR_FEATURE)
        self.threshold = threshold
        self.below, self.above = checked_shots(below), checked_shots(above)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Shots by the side of the threshold on which the last signal-to-noise was."""
        low = np.asarray(observation)[..., self._index] < self.threshold
        return single(np.where(low, self.below.action, self.above.action))

    def __str__(self) -> str:
        """The rule in words."""
        return f"{self.below:d} DCS where {SNR_FEATURE} < {self.threshold:.3f}, else {self.above:d}"


class GuardedPolicy(Policy):
    """Another policy's choice, or fewer shots where these could trip the laser."""

    def __init__(self, policy: Policy, guard: ThermalGuard) -> None:
        self._policy, self._guard = policy, guard

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """What the guard makes of the policy's choice."""
        return single(self._guard(observation, self._policy.act(observation, info)))

    def reset(self) -> None:
        """Start the policy anew."""
        self._policy.reset()


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

        from unwrap.files import write_bytes, write_json

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


def checked_shots(shots: int) -> Shots:
    """`shots` as `Shots`.

    Raises
    ------
    ValueError
        It is not 2, 4 or 8.
    """
    if shots not in tuple(Shots):
        raise ValueError(f"shots is {shots!r}; expected 2, 4 or 8")
    return Shots(shots)


def batch_shape(observation: Observation) -> tuple[int, ...]:
    """() for the observation of one environment, (N,) for a batch of N."""
    features = observation["state"] if isinstance(observation, Mapping) else observation
    return np.shape(features)[:-1]


def like(observation: Observation, action: int) -> Action:
    """`action` for one environment or for each of a batch, as `observation` has it."""
    return single(np.full(batch_shape(observation), action, dtype=np.int64))


def single(actions: np.ndarray | np.integer) -> Action:
    """A Python int where there is no batch."""
    return int(actions) if np.ndim(actions) == 0 else np.asarray(actions)


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
