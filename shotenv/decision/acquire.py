"""One acquisition of the drive's current frames: light -> raw -> depth -> score and features."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from shotenv.decision.drive import Drive
from shotenv.decision.features import SEEN_FEATURES, Sums, evaluated
from shotenv.decision.problem import Problem
from shotenv.decision.score import DepthScore, score_depth
from shotenv.sensor import (
    acquire,
    incident_light,
    noise_samples,
    sample_noise_lsb,
    scored_pixels,
    sensitivity,
)
from unwrap.depth import correct
from unwrap.signal import GRAY_FULL_SCALE, DepthFrame, RawFrame, Sensed, Shots
from unwrap.support import array, loop

Array = np.ndarray
ZERO, ONE_M, FOUR = np.float32(0.0), np.float32(1.0), np.float32(4.0)


@dataclass(frozen=True)
class Acquisition:
    """What one acquisition made of a batch of frames, and the truth beside it.

    Attributes
    ----------
    raw, depth : RawFrame, DepthFrame
        Samples and corrected depth.
    predicted_m, noise_lsb, truth_m : float32 [B, H, W]
        The network's distance, the sensor's own estimate of a sample's noise, the truth.
    scored : bool [B, H, W]
        Where the pixel counts.
    """

    raw: RawFrame
    depth: DepthFrame
    predicted_m: Tensor
    noise_lsb: Tensor
    truth_m: Tensor
    scored: Tensor


@dataclass(frozen=True)
class Measured:
    """What is known after an acquisition.

    Attributes
    ----------
    score : DepthScore
        Against the truth; pays the reward.
    seen : float32 [B, len(SEEN_FEATURES)]
        What the sensor itself can tell; only the features `TOLD` by the shots mean something.
    """

    score: DepthScore
    seen: Tensor


def noise_of(drive: Drive, step: Tensor, height: int, width: int) -> Iterator[Tensor]:
    """Normals [B, 2, H, W], sample after sample, of the frames at `step` [B].

    Each drive has its own stream.
    """
    return noise_samples(drive.seed.tolist(), step.tolist(), height, width)


def acquire_depth(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    shots: Shots,
    power_w: Tensor | None = None,
    *,
    noise: Iterable[Tensor] | None = None,
) -> Acquisition:
    """Acquire and correct the frames at `step` [B] of `drive` with `shots` samples each.

    `power_w` [B] is the laser's power while on where it is not the drive's own; `noise` gives the
    normals [B, 2, H, W] of each sample, and None draws the drive's own.
    """
    bank, sensor, frames = problem.bank, problem.config.sensor, drive.frame(step)
    if noise is None:
        noise = noise_of(drive, step, bank.height, bank.width)
    exposure = bank.exposure(frames)
    full = light = incident_light(exposure, drive.sensitivity)
    if power_w is not None:
        light = incident_light(exposure, sensitivity(sensor, power_w, drive.integration_s))
    raw = acquire(light, sensor, shots=shots, noise=noise, offsets=drive.offsets)
    scored = scored_pixels(full, exposure.distance_m, sensor)
    noise_lsb = sample_noise_lsb(
        bank.gray(frames), problem.gray_exposure_s.take(frames), drive.integration_s, sensor
    )
    predicted_m = predict(problem, drive, frames, raw, noise_lsb)
    depth = correct(
        raw,
        predicted_m,
        problem.description,
        merge=problem.config.merge,
        # Four samples of a frequency cancel the offset by themselves.
        offset_lsb=drive.offsets.calibrated_lsb if shots == Shots.TWO else None,
        noise_lsb=noise_lsb,
        shift_m=drive.drift_m,
    )
    return Acquisition(raw, depth, predicted_m, noise_lsb, exposure.distance_m, scored)


def predict(
    problem: Problem, drive: Drive, frames: Tensor, raw: RawFrame, noise_lsb: Tensor
) -> Tensor:
    """The network's distance float32 [B, H, W] of the bank frames `frames` [B].

    Kept where the gray image is all that it looks at; else made of the samples `raw`, which have
    the noise `noise_lsb` [B, H, W]. Nothing of the frame before is shown to the network.
    """
    if problem.fusion is None:
        return problem.kept.distance_of(frames)
    sensed = Sensed(
        gray=problem.bank.gray(frames).to(torch.float32) / GRAY_FULL_SCALE,
        raw=raw,
        offset_lsb=drive.offsets.calibrated_lsb,
        noise_lsb=noise_lsb,
        shift_m=drive.drift_m,
    )
    return problem.fusion.look(sensed, problem.description).distance_m


def measure(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    shots: Shots,
    power_w: Tensor | None = None,
    *,
    noise: Iterable[Tensor] | None = None,
) -> Measured:
    """Acquire, correct and score the frames at `step` [B] of `drive`; see `acquire_depth`."""
    made = acquire_depth(problem, drive, step, shots, power_w, noise=noise)
    score = score_depth(
        made.depth.distance_m,
        made.depth.valid,
        made.truth_m,
        made.scored,
        error_scale_m=problem.config.reward.error_scale_m,
        unambiguous_m=made.depth.unambiguous_m,
        range_m=problem.config.sensor.max_range_m,
    )
    return Measured(score, evaluated(SEEN_FEATURES, sums_of(made)))


def sums_of(made: Acquisition) -> Sums:
    """What the pixels of an acquisition tell without the truth, summed over each frame."""
    depth, sums = made.depth, np.empty((6, len(made.depth.distance_m)))
    _sum_pixels(
        array(depth.amplitude),
        # With two samples there is none; what is made of it is then not told.
        array(depth.amplitude if depth.residual is None else depth.residual),
        array(made.noise_lsb),
        array(depth.valid, np.bool_),
        array(made.raw.saturated, np.bool_),
        array(depth.distance_m),
        array(made.predicted_m),
        sums,
    )
    valid, saturated, amplitude_lsb, strength, residual, disagreement = torch.from_numpy(sums)
    pixels = torch.full_like(valid, depth.valid.shape[1] * depth.valid.shape[2])
    return Sums(pixels, valid, saturated, amplitude_lsb, strength, residual, disagreement)


@loop
def _sum_pixels(
    amplitude_lsb: Array,
    residual_lsb: Array,
    noise_lsb: Array,
    valid: Array,
    saturated: Array,
    distance_m: Array,
    predicted_m: Array,
    found: Array,
) -> None:
    """The fields of `Sums` but the pixels, float64 [6, B], of maps [B, H, W].

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
