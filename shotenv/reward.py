"""Scores of a depth frame and the reward: named bounded terms times weights."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

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
    counted, good = scored.to(distance_m.dtype), valid.to(distance_m.dtype)
    maps = score_maps(
        distance_m,
        good,
        truth_m,
        counted,
        error_scale_m=error_scale_m,
        unambiguous_m=unambiguous_m,
    )
    return score_of(frame_sums(*maps), range_m)


def score_maps(
    distance_m: Tensor,
    valid: Tensor,
    truth_m: Tensor,
    scored: Tensor,
    *,
    error_scale_m: float,
    unambiguous_m: float,
) -> tuple[Tensor, ...]:
    """What a score sums over each frame, six maps [B, H, W]; `valid` and `scored` are 0 and 1.

    In the order of `DepthScore` numerators, in metres where they are errors; and `scored`.
    """
    good = valid * scored
    error_m = (distance_m - truth_m).abs_()
    error_m = error_m.nan_to_num_(FARTHEST_ERROR_M, FARTHEST_ERROR_M)
    good_error_m = error_m * good
    bounded = (error_m * scored).div_(error_m + error_scale_m)
    right = below(error_m, 0.5 * unambiguous_m).mul_(good)
    return bounded, good_error_m, error_m.mul_(good_error_m), right, good, scored


DIVISORS = torch.tensor([5, 4, 4, 5, 5])
"""Which of the six sums each of the others is divided by."""


def score_of(sums: Tensor, range_m: float) -> DepthScore:
    """Score of sums [6 or more, B], of which the first six are those of `score_maps`."""
    counts = sums.index_select(0, DIVISORS)
    means = sums[:5] / counts.clamp(min=1)
    means[2].sqrt_()
    return DepthScore(*torch.where(counts == 0, _nothing_counted(range_m), means).unbind())


@lru_cache(maxsize=16)
def _nothing_counted(range_m: float) -> Tensor:
    """Score, float64 [5, 1], where there is no pixel to count."""
    return torch.tensor([[0.0], [range_m], [range_m], [1.0], [1.0]], dtype=torch.float64)


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
    weight_of = weights(config)
    total = terms["error"] * -weight_of.pop("error")
    for name, weight in weight_of.items():
        total.sub_(terms[name], alpha=weight)
    return total
