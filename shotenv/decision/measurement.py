"""What an acquisition is worth: its score against the truth, and what the sensor can tell."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from shotenv.decision.acquire import Acquisition, acquire_depth
from shotenv.decision.drive import Drive
from shotenv.decision.features import SEEN_FEATURES, TOLD, Sums, evaluated
from shotenv.decision.problem import Problem
from shotenv.decision.score import DepthScore, no_depth, score_depth
from shotenv.decision.state import State
from unwrap.signal import Shots
from unwrap.support import array, loop, put, take

Array = np.ndarray
# One Python float among them would make the arithmetic of the loops float64.
ZERO, ONE_M, FOUR = np.float32(0.0), np.float32(1.0), np.float32(4.0)


@dataclass(frozen=True)
class Measurement:
    """What is known after an acquisition; batch B.

    Attributes
    ----------
    score : DepthScore
        Against the truth; pays the reward.
    features : float32 [B, len(SEEN_FEATURES)]
        What the sensor itself can tell; only the features `TOLD` by the shots mean something.
    """

    score: DepthScore
    features: Tensor


Measure = Callable[[Problem, Drive, Tensor, Shots, Tensor | None], Measurement]
"""`measure_frames`, or what gives the same numbers faster (`MeasurementCache`)."""


def measure_frames(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    shots: Shots,
    power_w: Tensor | None = None,
    *,
    noise: Iterable[Tensor] | None = None,
) -> Measurement:
    """Acquire, correct and score the frames at `step` [B] of `drive`; see `acquire_depth`."""
    acquisition = acquire_depth(problem, drive, step, shots, power_w, noise=noise)
    # Over the pixels that the drive's own laser would light enough, whatever was emitted now.
    score = score_depth(
        acquisition.depth.distance_m,
        acquisition.depth.valid,
        acquisition.truth_m,
        acquisition.scored,
        error_scale_m=problem.config.reward.error_scale_m,
        unambiguous_m=acquisition.depth.unambiguous_m,
        range_m=problem.config.sensor.max_range_m,
    )
    return Measurement(score, evaluated(SEEN_FEATURES, sums_of(acquisition)))


def measure_by_shots(
    problem: Problem, state: State, shots: Tensor, power_w: Tensor, measure: Measure
) -> Measurement:
    """Measure the frame of every drive with its own number of samples.

    Drives that take the same number are one batch. A feature that these samples cannot tell stays
    as an earlier frame told it: after 8, then 2 DCS, `disagreement` is that of the 8.

    Parameters
    ----------
    shots : int64 [B]
        0, 2, 4 or 8; with 0 there is no depth.
    power_w : float64 [B]
        What each laser emits while on, W.
    """
    drive, step, before = state.drive, state.step, state.seen.features
    counts = set(shots.tolist())
    if len(counts) == 1 and 0 not in counts:
        # The whole batch as it is: picking rows would copy the offsets of every pixel.
        found = measure(problem, drive, step, Shots(counts.pop()), power_w)
    else:
        found = Measurement(no_depth(len(shots), problem.config.sensor.max_range_m), before)
        for count in sorted(counts - {0}):
            rows = (shots == count).nonzero().squeeze(1)
            part = measure(problem, take(drive, rows), step[rows], Shots(count), power_w[rows])
            found = put(found, rows, part)
    return Measurement(
        found.score, torch.where(TOLD.index_select(0, shots), found.features, before)
    )


def sums_of(acquisition: Acquisition) -> Sums:
    """What the pixels of an acquisition tell without the truth, summed over each frame."""
    depth, sums = acquisition.depth, np.empty((6, len(acquisition.depth.distance_m)))
    sum_pixels_(
        array(depth.amplitude),
        # With two samples there is none; what is made of it is then not told.
        array(depth.amplitude if depth.residual is None else depth.residual),
        array(acquisition.noise_lsb),
        array(depth.valid, np.bool_),
        array(acquisition.raw.saturated, np.bool_),
        array(depth.distance_m),
        array(acquisition.predicted_m),
        sums,
    )
    valid, saturated, amplitude_lsb, strength, residual, disagreement = torch.from_numpy(sums)
    pixels = torch.full_like(valid, depth.valid.shape[1] * depth.valid.shape[2])
    return Sums(pixels, valid, saturated, amplitude_lsb, strength, residual, disagreement)


@loop
def sum_pixels_(
    amplitude_lsb: Array,
    residual_lsb: Array,
    noise_lsb: Array,
    valid: Array,
    saturated: Array,
    distance_m: Array,
    predicted_m: Array,
    found: Array,
) -> None:
    """Write the fields of `Sums` but the pixels into `found`, float64 [6, B], of maps [B, H, W].

    Sums go column by column first, as those of scores do.
    """
    frames, rows, columns = valid.shape
    for b in range(frames):
        sums, counts = np.zeros((4, columns)), np.zeros((2, columns), np.int32)
        for i in range(rows):
            for j in range(columns):
                four_sigma_lsb = FOUR * noise_lsb[b, i, j]
                amplitude, residual = amplitude_lsb[b, i, j], residual_lsb[b, i, j]
                apart_m = abs(distance_m[b, i, j] - predicted_m[b, i, j])
                counts[0, j] += valid[b, i, j]
                counts[1, j] += saturated[b, i, j]
                sums[0, j] += amplitude
                sums[1, j] += amplitude / (amplitude + four_sigma_lsb)
                sums[2, j] += residual / (residual + four_sigma_lsb)
                sums[3, j] += apart_m / (apart_m + ONE_M) if valid[b, i, j] else ZERO
        found[0, b], found[1, b] = counts[0].sum(), counts[1].sum()
        for k in range(4):
            found[2 + k, b] = sums[k].sum()
