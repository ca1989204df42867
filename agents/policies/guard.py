"""A guard around a scheduler: no shots that could bring the laser to its trip in this frame.

A trip costs as much as hundreds of good choices earn, and whether one is near can be read off the
temperature; so it is left to a rule, and learning is about everything else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import torch

from agents.config import DemoConfig
from agents.policies.policy import Action, Observation, Policy, single
from shotenv.config import EnvConfig
from shotenv.decision import FEATURE_NAMES, feature_index, heat_margin_k
from shotenv.laser import laser_step, shot_cost, start_laser
from unwrap.signal import Shots

MARGIN_FEATURE: Final = "heat_margin"


class ThermalGuard:
    """Takes fewer shots where the chosen ones could trip the laser.

    Parameters
    ----------
    feature_names : sequence of str
        `env.unwrapped.feature_names`, to find the margin in the observation.
    needed_k : sequence of float
        Margin to the trip that each action needs, kelvin, rising; with less the next lower one is
        taken. The lowest action is always allowed.
    """

    def __init__(self, feature_names: Sequence[str], needed_k: Sequence[float]) -> None:
        self.feature_names, self.needed_k = tuple(feature_names), tuple(needed_k)
        self._index = feature_index(self.feature_names, MARGIN_FEATURE)

    def __call__(self, observation: Any, actions: Any) -> np.ndarray:
        """The actions [N] (or []) that are allowed in place of `actions`."""
        margin_k = heat_margin_k(np.asarray(observation)[..., self._index])
        # The margins rise with the shots, so counting those that are met gives the highest action;
        # the first is not asked for, since fewer than 2 samples cannot be taken.
        highest = sum((margin_k >= needed).astype(np.int64) for needed in self.needed_k[1:])
        return np.minimum(actions, highest)


def thermal_guard(config: DemoConfig) -> ThermalGuard:
    """The guard of `config`: `agent.guard` times the most that a frame can warm the laser by."""
    needed_k = [config.agent.guard * rise_k for rise_k in largest_rises_k(config.env)]
    return ThermalGuard(FEATURE_NAMES, needed_k)


def largest_rises_k(config: EnvConfig) -> tuple[float, ...]:
    """What each action can warm the laser by in one frame at most, kelvin.

    That is, in a drive with the hottest surroundings, the strongest laser and the longest
    integration. One frame is worth more kelvin the colder the laser is, since a warm one also loses
    more to its surroundings; only lasers near the trip matter, and the release temperature, which
    lies below it, bounds their rises from above.
    """
    laser, shots = config.laser, torch.tensor([int(shots) for shots in Shots])

    def every(value: float) -> torch.Tensor:
        return torch.full(shots.shape, value, dtype=torch.float64)

    # Two temperatures on purpose, each the worst: a hot laser turns more of its energy into heat, a
    # cold one keeps more of the heat.
    cost = shot_cost(
        shots,
        laser,
        optical_power_w=every(laser.optical_power_w[1]),
        temperature_k=every(laser.trip_k),
        integration_s=every(config.sensor.integration_s[1]),
        frame_period_s=1.0 / config.frame_rate_hz,
    )
    before = start_laser(every(laser.release_k))
    after = laser_step(before, cost, every(laser.ambient_k[1]), laser, 1.0 / config.frame_rate_hz)
    return tuple((after.temperature_k - before.temperature_k).clamp(min=0.0).tolist())


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
