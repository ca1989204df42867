"""Scores of a depth frame and the reward: named bounded terms times weights."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.config import RewardConfig
from shotenv.frames import ShotCost
from unwrap.merge import below

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
        Mean of |e| / (|e| + scale) of the distance that is delivered, the best guess where it is
        not valid; 1 where there is none. In 0..1.
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


def frame_sums(*maps: Tensor) -> Tensor:
    """Sum of each frame of each of the maps [B, H, W], float64 [len(maps), B].

    Row by row, because a sum over a whole frame at once is split among threads, and then its
    last bit depends on how many there are.
    """
    rows = maps[0].new_empty(len(maps), *maps[0].shape[:-1])
    for row, values in zip(rows.unbind(0), maps, strict=True):
        torch.sum(values, dim=-1, out=row)
    return rows.sum(dim=-1, dtype=torch.float64)


FARTHEST_ERROR_M = 1e9
"""Stands for the error where there is no distance: its term is 1 within the rounding of a float."""


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
    """Score depth [B, H, W] against the truth over the pixels `scored`.

    `valid` and `scored` are bool, or float with 0 and 1 (float masks are several times faster).
    """
    counted = scored.to(distance_m.dtype)
    good = valid.to(distance_m.dtype) * counted
    error_m = (distance_m - truth_m).abs_()
    error_m = error_m.nan_to_num_(FARTHEST_ERROR_M, FARTHEST_ERROR_M)
    good_error_m = error_m * good
    sums = frame_sums(
        (error_m * counted).div_(error_m + error_scale_m),
        below(error_m, 0.5 * unambiguous_m).mul_(good),
        good,
        counted,
        good_error_m,
        error_m.mul_(good_error_m),
    )
    _, _, good_count, count, *_ = sums.unbind()
    shares, means_m = sums[:3] / count.clamp(min=1), sums[4:] / good_count.clamp(min=1)
    shares[1:].masked_fill_(count == 0, 1.0)
    means_m[1].sqrt_()
    means_m.masked_fill_(good_count == 0, range_m)
    (error, right, valid_share), (absolute_m, squared_m) = shares.unbind(), means_m.unbind()
    return DepthScore(error, absolute_m, squared_m, right, valid_share)


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
    total = torch.zeros_like(terms["error"])
    for name, weight in weights(config).items():
        total.sub_(terms[name], alpha=weight)
    return total
