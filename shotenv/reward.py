"""Scores of a depth frame and the reward: named bounded terms times weights."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.config import RewardConfig
from shotenv.frames import ShotCost

TERMS = ("error", "duty", "power", "tripped")
"""Order of the reward terms, also in `info["vector_reward"]`; each lies in 0..1."""


@dataclass(frozen=True)
class DepthScore:
    """How good the depth of each frame is, over its scored pixels; float64 [B].

    A pixel is scored where the truth lies within the range and the drive's own laser gives a
    noise-free single-sample signal-to-noise ratio above `min_snr`: the same pixels whatever the
    shots. In a frame with no scored pixel every policy has error 0 and shares 1.

    Attributes
    ----------
    error : [B]
        Mean of |e| / (|e| + scale); an invalid pixel counts as 1. In 0..1.
    depth_mae_m, depth_rmse_m : [B]
        Over the valid ones; the scored range where there is none.
    wrap_accuracy : [B]
        Share that is valid and errs by less than half an unambiguous range.
    valid_share : [B]
        Share that is valid.
    """

    error: Tensor
    depth_mae_m: Tensor
    depth_rmse_m: Tensor
    wrap_accuracy: Tensor
    valid_share: Tensor


def frame_sum(values: Tensor) -> Tensor:
    """Sum of each frame [B] of [B, H, W], float64.

    Row by row, because a sum over a whole frame at once is split among threads, and then its
    last bit depends on how many there are.
    """
    return values.sum(dim=-1).to(torch.float64).sum(dim=-1)


def score_depth(
    distance_m: Tensor,
    valid: Tensor,
    truth_m: Tensor,
    scored: Tensor,
    *,
    error_scale_m: float,
    unambiguous_m: float,
    range_m: float,
) -> DepthScore:
    """Score depth [B, H, W] against the truth over the pixels `scored`."""
    counted = scored.to(distance_m.dtype)
    good = counted * valid
    # NaN and infinity outside the good pixels must not spread through a product with zero.
    error_m = torch.where(good > 0, distance_m - truth_m, 0.0).abs_()
    bounded = error_m / (error_m + error_scale_m)
    scored_count, good_count = frame_sum(counted), frame_sum(good)
    right_count = frame_sum(good * (error_m < 0.5 * unambiguous_m))
    nothing, any_good = scored_count == 0, good_count > 0
    scored_count, good_divisor = scored_count.clamp(min=1), good_count.clamp(min=1)
    invalid_count = scored_count - good_count
    error = (frame_sum(bounded) + invalid_count) / scored_count
    mae_m, mse_m2 = frame_sum(error_m) / good_divisor, frame_sum(error_m**2) / good_divisor
    return DepthScore(
        error=torch.where(nothing, 0.0, error),
        depth_mae_m=torch.where(any_good, mae_m, range_m),
        depth_rmse_m=torch.where(any_good, mse_m2.sqrt(), range_m),
        wrap_accuracy=torch.where(nothing, 1.0, right_count / scored_count),
        valid_share=torch.where(nothing, 1.0, good_count / scored_count),
    )


def no_depth(batch: int, range_m: float) -> DepthScore:
    """Score of frames without laser: full error, nothing valid."""
    one, zero = torch.ones(batch, dtype=torch.float64), torch.zeros(batch, dtype=torch.float64)
    return DepthScore(one, one * range_m, one * range_m, zero, zero)


def reward_terms(
    score: DepthScore, cost: ShotCost, always_eight: ShotCost, tripped: Tensor
) -> dict[str, Tensor]:
    """Unweighted terms, each float64 [B] in 0..1.

    `duty` and `power` are relative to what eight samples in every frame of the same drive cost.
    """
    return {
        "error": score.error,
        "duty": cost.duty / always_eight.duty,
        "power": cost.energy_j / always_eight.energy_j,
        "tripped": tripped.to(torch.float64),
    }


def weights(config: RewardConfig) -> dict[str, float]:
    """Weight of each term."""
    return {
        "error": config.error,
        "duty": config.duty,
        "power": config.power,
        "tripped": config.trip,
    }


def reward(terms: dict[str, Tensor], config: RewardConfig) -> Tensor:
    """Minus the weighted sum of the terms, float64 [B]."""
    return -sum(weight * terms[name] for name, weight in weights(config).items())
