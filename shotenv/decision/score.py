"""How good a depth frame is: error and shares over its scored pixels."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Final

import numpy as np
import torch
from torch import Tensor

from unwrap.support import array, long_rows, loop

Array = np.ndarray


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
    within_0p1m : [B]
        Share that is valid and errs by less than `CLOSE_M`.
    """

    error: Tensor
    depth_mae_m: Tensor
    depth_rmse_m: Tensor
    wrap_accuracy: Tensor
    valid_share: Tensor
    within_0p1m: Tensor


SCORES: Final = tuple(field.name for field in fields(DepthScore))
ZERO, FOUR_SIGMA = np.float32(0.0), np.float32(4.0)
SUMMED = 64
"""Pixels of a small map that are summed side by side: rows of this length at most."""
CLOSE_M = np.float32(0.1)
"""Above the noise of well lit pixels, far below half an unambiguous range (3 m): 1 % of 10 m,
what such sensors are often specified to [assumed]; the limit of the depth metric of this name."""
FARTHEST_ERROR_M = np.float32(1e9)
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
    """Score depth float32 [B, H, W] against the truth over the pixels `scored`, bool [B, H, W].

    Raises
    ------
    ValueError
        The maps have different shapes.
    """
    shape = distance_m.shape
    if not shape == valid.shape == truth_m.shape == scored.shape:
        shapes = [tuple(maps.shape) for maps in (distance_m, valid, truth_m, scored)]
        raise ValueError(f"distance_m, valid, truth_m and scored are {shapes}; expected one shape")
    score = np.empty((len(SCORES), len(distance_m)))
    score_pixels_(
        long_rows(array(distance_m), SUMMED),
        long_rows(array(valid, np.bool_), SUMMED),
        long_rows(array(truth_m), SUMMED),
        long_rows(array(scored, np.bool_), SUMMED),
        np.float32(error_scale_m),
        np.float32(0.5 * unambiguous_m),  # Less far off, the wrap count is right.
        range_m,
        score,
    )
    return DepthScore(*torch.from_numpy(score).unbind())


@loop
def score_pixels_(
    distance_m: Array,
    valid: Array,
    truth_m: Array,
    scored: Array,
    scale_m: np.float32,
    near_m: np.float32,
    range_m: float,
    score: Array,
) -> None:
    """Write the fields of a `DepthScore` into `score`, float64 [6, B], of maps [B, H, W].

    Sums go column by column first: neighbours are summed side by side, in an order that does not
    depend on the processor.
    """
    frames, rows, columns = distance_m.shape
    for b in range(frames):
        sums, counts = np.zeros((3, columns)), np.zeros((4, columns), np.int32)
        for i in range(rows):
            for j in range(columns):
                error_m = abs(distance_m[b, i, j] - truth_m[b, i, j])
                # `not <` and not `>=`: NaN is neither.
                if not error_m < FARTHEST_ERROR_M:
                    error_m = FARTHEST_ERROR_M
                counted = scored[b, i, j]
                good = counted & valid[b, i, j]
                sums[0, j] += error_m / (error_m + scale_m) if counted else ZERO
                sums[1, j] += error_m if good else ZERO
                sums[2, j] += error_m * error_m if good else ZERO
                counts[0, j] += counted
                counts[1, j] += good
                counts[2, j] += good & (error_m < near_m)
                counts[3, j] += good & (error_m < CLOSE_M)
        all_scored, all_valid = counts[0].sum(), counts[1].sum()
        all_near, all_close = counts[2].sum(), counts[3].sum()
        # A frame without scored pixels must not count for or against anyone.
        score[0, b] = sums[0].sum() / all_scored if all_scored else 0.0
        score[1, b] = sums[1].sum() / all_valid if all_valid else range_m
        score[2, b] = np.sqrt(sums[2].sum() / all_valid) if all_valid else range_m
        score[3, b] = all_near / all_scored if all_scored else 1.0
        score[4, b] = all_valid / all_scored if all_scored else 1.0
        score[5, b] = all_close / all_scored if all_scored else 1.0


def no_depth(batch: int, range_m: float) -> DepthScore:
    """Score of frames without laser: full error, nothing valid."""
    one, zero = torch.ones(batch, dtype=torch.float64), torch.zeros(batch, dtype=torch.float64)
    return DepthScore(one, one * range_m, one * range_m, zero, zero, zero)


def unscored(batch: int) -> DepthScore:
    """Score of frames that nothing is known of: no error that counts, and no measure."""
    zero = torch.zeros(batch, dtype=torch.float64)
    return DepthScore(zero, *(torch.full_like(zero, torch.nan) for _ in SCORES[1:]))


def error_beside(
    apart_m: Tensor, truth_error_m: Tensor, scored: Tensor, error_scale_m: float
) -> Tensor:
    """Error term float64 [B] of depth that lies `apart_m` from a truth that errs itself, [B, H, W].

    The largest mean error that both allow, their sum, over the pixels `scored`; 0 where there is
    none.
    """
    error_m = apart_m + truth_error_m
    term = torch.where(scored, error_m / (error_m + error_scale_m), 0.0)
    total = term.sum(dim=-1).sum(dim=-1, dtype=torch.float64)
    return total / scored.sum(dim=(-2, -1)).clamp(min=1)


@loop
def sum_pixels_(
    amplitude_lsb: Array,
    residual_lsb: Array,
    noise_lsb: Array,
    valid: Array,
    saturated: Array,
    distance_m: Array,
    by_two_m: Array,
    by_four_m: Array,
    scale_m: np.float32,
    found: Array,
) -> None:
    """Write the fields of `features.Sums`, all but the pixels, of maps [B, H, W].

    Into `found`, float64 [8, B]. Sums go column by column first, as those of scores do.
    """
    frames, rows, columns = valid.shape
    for b in range(frames):
        sums, counts = np.zeros((6, columns)), np.zeros((2, columns), np.int32)
        for i in range(rows):
            for j in range(columns):
                four_sigma_lsb = FOUR_SIGMA * noise_lsb[b, i, j]
                amplitude, residual = amplitude_lsb[b, i, j], residual_lsb[b, i, j]
                strong = valid[b, i, j]
                two_m = abs(by_two_m[b, i, j] - distance_m[b, i, j])
                four_m = abs(by_four_m[b, i, j] - distance_m[b, i, j])
                apart_m = abs(by_two_m[b, i, j] - by_four_m[b, i, j])
                counts[0, j] += strong
                counts[1, j] += saturated[b, i, j]
                sums[0, j] += amplitude
                sums[1, j] += amplitude / (amplitude + four_sigma_lsb)
                sums[2, j] += residual / (residual + four_sigma_lsb)
                sums[3, j] += two_m / (two_m + scale_m) if strong else ZERO
                sums[4, j] += four_m / (four_m + scale_m) if strong else ZERO
                sums[5, j] += apart_m / (apart_m + scale_m) if strong else ZERO
        found[0, b], found[1, b] = counts[0].sum(), counts[1].sum()
        for k in range(6):
            found[2 + k, b] = sums[k].sum()
