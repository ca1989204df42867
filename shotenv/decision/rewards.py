"""The reward: named bounded terms times weights, relative to what 4 DCS bring in the same frame."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.config import RewardConfig
from shotenv.decision.drive import Drive
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


def reference_terms(error_of_four: Tensor, drive: Drive) -> dict[str, Tensor]:
    """Terms of 4 DCS with a laser that heat never holds back; no action changes them.

    Parameters
    ----------
    error_of_four : float64 [B]
        Error term of 4 DCS in the same frames, with the same noise and the drive's own power.
    """
    four, eight = drive.always_four, drive.always_eight
    return {
        "error": error_of_four,
        "duty": (four.duty / eight.duty).expand_as(error_of_four),
        "power": (four.energy_j / eight.energy_j).expand_as(error_of_four),
        "tripped": torch.zeros_like(error_of_four),
    }


def weighted(terms: dict[str, Tensor], power_price: Tensor, config: RewardConfig) -> Tensor:
    """Weighted sum of the terms, float64 [B]: what a frame costs, in units of the error term.

    Parameters
    ----------
    power_price : float64 [B]
        Weight of the term `power` in each drive.
    """
    # Always in this order: the last bit of a sum depends on it.
    total = terms["error"] * config.error + terms["duty"] * config.duty
    return total + terms["power"] * power_price + terms["tripped"] * config.trip


def reward(
    terms: dict[str, Tensor],
    reference: dict[str, Tensor],
    power_price: Tensor,
    config: RewardConfig,
) -> Tensor:
    """How much less the terms weigh than those of 4 DCS, scaled; float64 [B].

    A frame's own difficulty, which no choice changes and which varies far more than what choices
    change, is in both and cancels.
    """
    saved = weighted(reference, power_price, config) - weighted(terms, power_price, config)
    return saved * config.scale
