"""The reward: named bounded terms times weights."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.config import RewardConfig
from shotenv.decision.score import DepthScore
from shotenv.laser import ShotCost

TERMS = ("error", "duty", "power", "tripped")
"""Order of the reward terms, also in `info["vector_reward"]`; each lies in 0..1."""


def reward_terms(
    score: DepthScore, cost: ShotCost, always_eight: ShotCost, tripped: Tensor
) -> dict[str, Tensor]:
    """Unweighted terms, each float64 [B] in 0..1.

    `duty` and `power` are relative to what eight samples in every frame of the same drive cost.
    """
    return {
        "error": score.error,
        "duty": cost.duty / always_eight.duty,
        # Whole energies, chips and networks too; the period cancels in the ratio of powers.
        "power": cost.energy_j / always_eight.energy_j,
        "tripped": tripped.to(torch.float64),
    }


def reward(terms: dict[str, Tensor], config: RewardConfig) -> Tensor:
    """Minus the weighted sum of the terms, float64 [B]."""
    total = terms["error"] * -config.error
    # Always in this order: the last bit of a sum depends on it.
    for name, weight in (("duty", config.duty), ("power", config.power), ("tripped", config.trip)):
        total.sub_(terms[name], alpha=weight)
    return total
