"""How good a depth frame is: error and shares over its scored pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from shotenv.sensor import (
    BLOCK,
    GrayNoise,
    IncidentLight,
    Pixel,
    Purpose,
    fill_normals_,
    mark_scored_,
    noise_by_gray_,
    take_sample_,
)
from unwrap.depth import DualLimits, Limits, fuse_pixels, merge_pixels
from unwrap.signal import TurnsTable, angle_pixels, decode_pixels
from unwrap.support import array, long_rows, loop, source_stamp

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
    """

    error: Tensor
    depth_mae_m: Tensor
    depth_rmse_m: Tensor
    wrap_accuracy: Tensor
    valid_share: Tensor


NOISE = int(Purpose.NOISE)
ZERO, FOUR_SIGMA = np.float32(0.0), np.float32(4.0)
SUMMED = 64
"""Pixels of a small map that are summed side by side: rows of this length at most."""
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
    score = np.empty((5, len(distance_m)))
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
    """Write the fields of a `DepthScore` into `score`, float64 [5, B], of maps [B, H, W].

    Sums go column by column first: neighbours are summed side by side, in an order that does not
    depend on the processor.
    """
    frames, rows, columns = distance_m.shape
    for b in range(frames):
        sums, counts = np.zeros((3, columns)), np.zeros((3, columns), np.int32)
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
        all_scored, all_valid, all_near = counts[0].sum(), counts[1].sum(), counts[2].sum()
        # A frame without scored pixels must not count for or against anyone.
        score[0, b] = sums[0].sum() / all_scored if all_scored else 0.0
        score[1, b] = sums[1].sum() / all_valid if all_valid else range_m
        score[2, b] = np.sqrt(sums[2].sum() / all_valid) if all_valid else range_m
        score[3, b] = all_near / all_scored if all_scored else 1.0
        score[4, b] = all_valid / all_scored if all_scored else 1.0


def no_depth(batch: int, range_m: float) -> DepthScore:
    """Score of frames without laser: full error, nothing valid."""
    one, zero = torch.ones(batch, dtype=torch.float64), torch.zeros(batch, dtype=torch.float64)
    return DepthScore(one, one * range_m, one * range_m, zero, zero)


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


class FramesTaken(NamedTuple):
    """What differs from frame to frame of a batch; maps are [B, H, W].

    Attributes
    ----------
    shots, seeds, steps : int64 [B]
        Samples taken, 0, 2, 4 or 8; what the noise is drawn by.
    light : IncidentLight
        With the drives' own laser power.
    emitted_e : float32 [B]
        As `light.active_e`, with the power that is emitted.
    truth_m, gray, predicted_m, pattern_lsb, calibrated_lsb
        True distance; words of the gray image; the network's distance; offset, and what is stored.
    noise_of_two, noise_of_more : GrayNoise
        Of a sample among two, and among more.
    shift1, shift2 : float32 [B]
        Turns that are added at f1 and f2.
    """

    shots: Array
    seeds: Array
    steps: Array
    light: IncidentLight
    emitted_e: Array
    truth_m: Array
    gray: Array
    predicted_m: Array
    pattern_lsb: Array
    calibrated_lsb: Array
    noise_of_two: GrayNoise
    noise_of_more: GrayNoise
    shift1: Array
    shift2: Array


class Chain(NamedTuple):
    """Constants of the way from light to scores.

    Attributes
    ----------
    parity, pixel, range_m, min_snr
        Of the sensor: see `take_sample_` and `mark_scored_`.
    table1, table2, limits, branch, dual
        Of the correction: see `merge_pixels` and `fuse_pixels`.
    fuses : bool
        Whether the frequencies of eight samples tell the wraps; else the prediction does.
    scale_m, near_m, worst_m
        Of the score: see `score_pixels_`.
    """

    parity: Array
    pixel: Pixel
    range_m: np.float32
    min_snr: np.float32
    table1: TurnsTable
    table2: TurnsTable
    limits: Limits
    branch: int
    dual: DualLimits
    fuses: bool
    scale_m: np.float32
    near_m: np.float32
    worst_m: float


def _frame_loop(stamp: int) -> Callable[..., bool]:
    """The loop `score_frames_`; `stamp` is that of the loops that it calls."""

    @loop
    def score_frames_(
        begin: int,
        end: int,
        taken: FramesTaken,
        chain: Chain,
        score: Array,
        error_of_four: Array,
        sums: Array,
    ) -> bool:
        """Acquire, correct and score frames, one after the other: all of one stays in the cache.

        The same loops in the same order as `acquire_depths`, `correct`, `score_depth` and
        `sums_of`, which keep the maps; a test holds them together to the last bit.

        Parameters
        ----------
        begin, end : int
            Frames of the batch that are worked on: threads share a batch.
        score, error_of_four, sums : float64 [5, B], [B], [8, B]
            Fields of `DepthScore`, the error term of 4 DCS with an undiminished laser, and fields
            of `features.Sums` but the pixels. Written; score and sums not where no sample is taken.

        Returns
        -------
        bool
            Whether all samples are finite.
        """
        used_for_the_cache_of_numba = stamp  # noqa: F841
        _, rows, columns = taken.truth_m.shape
        one = (1, rows, columns)
        words = np.empty((4, BLOCK), np.uint32)
        normals = np.empty((2, 1, 2, rows * columns), np.float32)
        samples = np.empty((8, rows, columns), np.float32)
        no_offset, noise = np.zeros(one, np.float32), np.empty(one, np.float32)
        cosine, sine = np.empty(one, np.float32), np.empty(one, np.float32)
        amplitude, residual = np.empty(one, np.float32), np.empty(one, np.float32)
        cosine2, amplitude2 = np.empty(one, np.float32), np.empty(one, np.float32)
        residual2 = np.empty(one, np.float32)
        distances = np.empty((3, 1, rows, columns), np.float32)
        saturated, scored = np.empty(one, np.bool_), np.empty(one, np.bool_)
        valid, finite = np.empty(one, np.bool_), True
        one_score, one_sums = np.empty((5, 1)), np.empty((8, 1))
        for b in range(begin, end):
            e = b + 1
            light, truth_m, shots = taken.light, taken.truth_m[b:e], taken.shots[b]
            derated = taken.emitted_e[b] != light.active_e[b]
            own = IncidentLight(
                light.correlation[b:e],
                light.active[b:e],
                light.ambient[b:e],
                light.active_e[b:e],
                light.ambient_e[b:e],
            )
            mark_scored_(own, chain.pixel, truth_m, chain.range_m, chain.min_snr, scored)
            # Once with what is emitted, and after that with the undiminished laser of the
            # reward's reference, if it differs.
            for derates in (True, False):
                if derates and not (derated and shots):
                    continue
                emitted_e = taken.emitted_e[b:e] if derates else light.active_e[b:e]
                lit = IncidentLight(
                    own.correlation, own.active, own.ambient, emitted_e, own.ambient_e
                )
                counts = derates or not derated
                last = max(shots, 4) if counts else 4
                saturated[:] = False
                for number in range(last):
                    if number % 2 == 0:
                        fill_normals_(
                            NOISE, taken.seeds[b:e], taken.steps[b:e], number // 2, words, normals
                        )
                    take_sample_(
                        number,
                        lit,
                        normals[number % 2].reshape((1, 2, rows, columns)),
                        taken.pattern_lsb[b:e],
                        chain.parity,
                        chain.pixel,
                        samples.reshape((1, 8, rows, columns)),
                        saturated,
                    )
                    count = number + 1
                    if count != 2 and count != 4 and count != 8:
                        continue
                    known = taken.noise_of_two if count == 2 else taken.noise_of_more
                    noise_by_gray_(
                        taken.gray[b:e],
                        known.variance_per_word[b:e],
                        known.dark,
                        known.offset_variance[b:e],
                        known.offset_per_word[b:e],
                        known.most_offset,
                        noise,
                    )
                    # Two samples hold the offset; see `offset_to_subtract_lsb`.
                    offset_lsb = taken.calibrated_lsb[b:e] if count == 2 else no_offset
                    at_f1 = min(count, 4)
                    finite &= decode_pixels(
                        samples[:at_f1].reshape((1, at_f1, rows, columns)),
                        offset_lsb,
                        cosine,
                        sine,
                        amplitude,
                        residual,
                    )
                    angle_pixels(sine.reshape(-1), cosine.reshape(-1), cosine.reshape(-1))
                    place = 0 if count == 2 else (1 if count == 4 else 2)
                    distance_m = distances[place]
                    merge_pixels(
                        cosine,
                        chain.table1,
                        taken.shift1[b:e],
                        amplitude,
                        noise,
                        saturated,
                        taken.predicted_m[b:e],
                        chain.limits,
                        chain.branch,
                        distance_m,
                        valid,
                    )
                    told = amplitude if count == 2 else residual
                    if count == 8 and chain.fuses:
                        finite &= decode_pixels(
                            samples[4:].reshape((1, 4, rows, columns)),
                            no_offset,
                            cosine2,
                            sine,
                            amplitude2,
                            residual2,
                        )
                        angle_pixels(sine.reshape(-1), cosine2.reshape(-1), cosine2.reshape(-1))
                        fuse_pixels(
                            cosine,
                            cosine2,
                            chain.table2,
                            taken.shift2[b:e],
                            amplitude2,
                            noise,
                            valid,
                            chain.dual,
                            distance_m,
                        )
                    is_reference = count == 4 and not derates
                    if not is_reference and not (counts and count == shots):
                        continue
                    score_pixels_(
                        distance_m,
                        valid,
                        truth_m,
                        scored,
                        chain.scale_m,
                        chain.near_m,
                        chain.worst_m,
                        one_score,
                    )
                    if is_reference:
                        error_of_four[b] = one_score[0, 0]
                    if counts and count == shots:
                        sum_pixels_(
                            amplitude,
                            told,
                            noise,
                            valid,
                            saturated,
                            distance_m,
                            distances[0],
                            distances[min(place, 1)],
                            chain.scale_m,
                            one_sums,
                        )
                        score[:, b], sums[:, b] = one_score[:, 0], one_sums[:, 0]
        return finite

    return score_frames_


score_frames_ = _frame_loop(
    source_stamp(fill_normals_, take_sample_, decode_pixels, merge_pixels, fuse_pixels)
)
