"""A scheduler with a memory of its own: an LSTM between the features and the score network."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from agents.policies.policy import Observation, ScoringPolicy
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
    require_widths,
    score_network,
    widths_of,
)

Memory = tuple[Tensor, Tensor]
"""Hidden and cell states of an LSTM, [1, N, M] each."""


class RecurrentNetwork(nn.Module):
    """Scores [N, 3] of a frame's features [N, D] after those before it, of N drives."""

    def __init__(self, memory: nn.LSTM, network: nn.Sequential) -> None:
        super().__init__()
        self.memory, self.network = memory, network

    def forward(self, features: Tensor, before: Memory | None) -> tuple[Tensor, Memory]:
        """Scores, and what is remembered; `before` the first frame nothing is."""
        told, after = self.memory(features[None], before)
        return self.network(told[0]), after


class RecurrentPolicy(ScoringPolicy):
    """An LSTM that reads the features frame after frame, and a network of its output that scores
    each action; the highest score wins.

    What it remembers of a drive is in no observation: it is kept here from `act` to `act`, for each
    drive of the batch, and forgotten at `reset`. Saved as `NetworkPolicy` is, without any pickle.

    Parameters
    ----------
    memory : nn.LSTM
        One layer, from features [1, N, D] to its M units; copied.
    network : nn.Sequential
        Linear layers with tanh or relu between, from [N, M] to scores [N, 3]; copied.
    provenance : Provenance

    Raises
    ------
    ValueError
        The parts have other forms, or do not fit each other, the features or the actions.

    Examples
    --------
    >>> told = Provenance(algorithm="none", feature_names=("power",))
    >>> policy = RecurrentPolicy(nn.LSTM(1, 4), score_network((4, 3), "tanh"), told)
    >>> first, second = (policy.scores(np.ones((2, 1))) for _ in range(2))
    >>> policy.reset()
    >>> (first == second).all(), (first == policy.scores(np.ones((2, 1)))).all()
    (np.False_, np.True_)
    """

    def __init__(self, memory: nn.LSTM, network: nn.Sequential, provenance: Provenance) -> None:
        form = memory.num_layers, memory.bias, memory.bidirectional, memory.proj_size
        if form != (1, True, False, 0):
            raise ValueError(f"memory is {memory}; expected an LSTM of one layer with biases")
        names = provenance.feature_names
        if memory.input_size != len(names):
            raise ValueError(
                f"memory reads {memory.input_size} features; expected {len(names)}: "
                + ", ".join(names)
            )
        self.activation = activation_of(network)
        require_widths(network, memory.hidden_size)
        whole = RecurrentNetwork(memory, network)
        self.network = copy.deepcopy(whole).requires_grad_(False).eval()
        self.provenance = provenance
        self._remembered: Memory | None = None

    @property
    def feature_names(self) -> tuple[str, ...]:
        """Elements of the observation, in order."""
        return self.provenance.feature_names

    @classmethod
    def from_recurrent_ppo(cls, policy: Any, provenance: Provenance) -> RecurrentPolicy:
        """The actor of sb3-contrib's RecurrentPPO (`model.policy`): its most probable action."""
        return cls(policy.lstm_actor, actor_network(policy), provenance)

    def scores(self, observation: Observation) -> np.ndarray:
        """Score of each action, float32 [..., 3], for features [..., D] of the next frame.

        Raises
        ------
        ValueError
            The observation has another number of features, or is of another number of drives than
            those that are remembered.
        """
        features = features_of(observation, self.feature_names)
        drives = features.reshape(-1, features.shape[-1])
        if self._remembered is not None and self._remembered[0].shape[1] != len(drives):
            raise ValueError(
                f"observation is of {len(drives)} drives, but {self._remembered[0].shape[1]} are "
                "remembered; `reset` forgets them"
            )
        with torch.inference_mode():
            scores, self._remembered = self.network(drives, self._remembered)
        return scores.reshape(*features.shape[:-1], -1).numpy()

    def reset(self) -> None:
        """Forget the drives: hidden and cell states begin at 0."""
        self._remembered = None

    def save(self, folder: Path) -> None:
        """Write `policy.safetensors`, then `agent.json`, each atomically."""
        layers = widths_of(self.network.network)
        description = Description(
            **self.provenance.model_dump(),
            layers=layers,
            activation=self.activation,
            memory=layers[0],
        )
        write_scheduler(folder, self.network, description)

    @classmethod
    def load(cls, folder: Path) -> RecurrentPolicy:
        """Scheduler saved in `folder`; `load_policy` reads those without memory, too.

        Raises
        ------
        ValueError
            The folder holds no such scheduler, or a damaged one; the message names the file.
        """
        told = read_description(folder / DESCRIPTION)
        if not told.memory:
            raise ValueError(f"{folder / DESCRIPTION}: memory: it has none; expected an LSTM")
        whole = RecurrentNetwork(
            nn.LSTM(len(told.feature_names), told.memory),
            score_network(told.layers, told.activation),
        )
        read_weights(folder, whole)
        try:
            return cls(whole.memory, whole.network, told.provenance)
        except ValueError as error:
            raise ValueError(f"{folder / DESCRIPTION}: layers: {error}") from None
