"""A start for PPO from what is known in training: every action's cost in every frame.

An action's outcome in a frame depends on the drive, the frame and the action alone, so that it can
be computed for all of them. The expected cost of a frame under an actor is then a plain sum that is
made small by gradient descent, without exploring and without noise. What actions do to later frames
by their heat is not in it; that is left to PPO.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import torch
from torch import Tensor

from agents.evaluation import play_drives
from agents.optimum import tabulate
from agents.policies import Action, Observation, Policy, RandomPolicy

if TYPE_CHECKING:
    from stable_baselines3.common.policies import ActorCriticPolicy

    from shotenv.env import ShotScheduleVectorEnv

# The numbers of this file are assumed.
ROLLOUTS: Final = 3
"""Times that the drives are played with random actions, for the observations they lead to."""
PASSES: Final = 20
BATCH: Final = 512
RATE: Final = 2e-3
WEIGHT_DECAY: Final = 1e-3
ENTROPY: Final = 0.2
"""Weight of the actor's entropy beside costs of unit spread: PPO needs it to try things."""


@dataclass(frozen=True)
class KnownFrames:
    """Frames in which the cost of every action is known.

    Attributes
    ----------
    observations : float32 [N, D]
    cost : float32 [N, A]
        Weighted reward terms of each action with a working laser.
    per_drive : int
        Frames that follow each other; then another drive begins.
    """

    observations: Tensor
    cost: Tensor
    per_drive: int = 1

    @property
    def advantage(self) -> Tensor:
        """Cost of each action beside the mean of the frame's, of unit spread, [N, A]."""
        # A frame's own difficulty is the same for all actions: nothing can be learnt from it.
        apart = self.cost - self.cost.mean(dim=1, keepdim=True)
        return apart / apart.std().clamp(min=1e-12)


def known_frames(
    envs: ShotScheduleVectorEnv,
    seeds: Sequence[int],
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> KnownFrames:
    """Frames of the drives `seeds`, as random actions meet them.

    `envs` has as many environments as there are seeds; `tick` is told the number of frames played,
    1 + `ROLLOUTS` times those of the drives in all.
    """
    problem = envs.problem
    cost = tabulate(problem, seeds, tick=tick).table().cost
    seen = []
    # The same frames are met again with other memories: what was seen last depends on the actions.
    for number in range(ROLLOUTS):
        recorded = _Recorded(RandomPolicy(number))
        play_drives(recorded, envs, seeds, tick=tick)
        seen.append(np.stack(recorded.observations, axis=1))
    observations = np.concatenate(seen)
    return KnownFrames(
        torch.from_numpy(observations.reshape(-1, observations.shape[-1])),
        torch.from_numpy(np.tile(cost, (ROLLOUTS, 1, 1)).reshape(-1, cost.shape[-1])).float(),
        per_drive=cost.shape[1],
    )


class _Recorded(Policy):
    """Another policy, with what it observed [N, D] frame after frame."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self.observations: list[np.ndarray] = []

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The other policy's choice."""
        self.observations.append(np.array(observation, dtype=np.float32))
        return self._policy.act(observation, info)

    def reset(self) -> None:
        """Start the other policy anew."""
        self._policy.reset()


def warm_start(network: ActorCriticPolicy, known: KnownFrames, *, seed: int) -> None:
    """Train the actor of `network` to make the expected cost of the known frames small.

    The result depends on the arguments alone; the critic stays as it is. A memory is shown whole
    drives, frame after frame.
    """
    generator = torch.Generator().manual_seed(seed)
    optimizer = torch.optim.AdamW(network.parameters(), RATE, weight_decay=WEIGHT_DECAY)
    length = known.per_drive if hasattr(network, "lstm_actor") else 1
    observations, advantage = (
        each.unflatten(0, (-1, length)) for each in (known.observations, known.advantage)
    )
    count, batch = len(advantage), max(BATCH // length, 1)
    batches = -(-count // batch)
    # The rate falls along a cosine to 0 over all steps.
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, PASSES * batches)
    network.set_training_mode(True)
    # No loss touches the critic: its gradients stay None, and AdamW leaves such parameters alone.
    for _ in range(PASSES):
        for rows in torch.randperm(count, generator=generator).split(batch):
            actor = _actor(network, observations[rows])
            expected = (actor.probs * advantage[rows].flatten(0, 1)).sum(dim=1)
            loss = (expected - ENTROPY * actor.entropy()).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            schedule.step()
    network.set_training_mode(False)


def _actor(network: Any, observations: Tensor) -> Any:
    """Distributions over the actions of drives [N, T, D], frame after frame, N * T of them."""
    frames = observations.flatten(0, 1)
    if not hasattr(network, "lstm_actor"):
        return network.get_distribution(frames).distribution
    # Nothing is remembered before the first frame, and no drive begins after it.
    state = torch.zeros(1, len(observations), network.lstm_actor.hidden_size)
    found, _ = network.get_distribution(frames, (state, state), torch.zeros(len(frames)))
    return found.distribution
