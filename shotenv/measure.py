"""One acquisition of the drive's current frames: light -> raw -> depth -> score and features."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.drive import Drive
from shotenv.observe import SEEN_FEATURES
from shotenv.problem import Problem
from shotenv.reward import DepthScore, frame_sums, score_maps, score_of
from shotenv.sensor import (
    Electrons,
    acquire,
    charge,
    collect,
    noise_samples,
    sample_noise_lsb,
    single_sample_snr,
)
from unwrap.acquisition import Shots
from unwrap.correction import correct_and_weigh
from unwrap.data import GRAY_FULL_SCALE
from unwrap.frames import DepthFrame, RawFrame
from unwrap.phase import unambiguous_range_m
from unwrap.sensed import Sensed


@dataclass(frozen=True)
class Acquisition:
    """What one acquisition made of a batch of frames, and the truth beside it.

    Attributes
    ----------
    raw, depth : RawFrame, DepthFrame
        Samples and corrected depth.
    predicted_m, noise_lsb, truth_m : float32 [B, H, W]
        The network's distance, the sensor's own estimate of a sample's noise, the truth.
    valid, scored : float32 [B, H, W]
        1 where the depth is valid, and where the pixel counts, else 0.
    """

    raw: RawFrame
    depth: DepthFrame
    valid: Tensor
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
    seen : float32 [B, 4, 5 or 6]
        What the sensor itself can tell: the first of `observe.SEEN_FEATURES`, the fifth with 4 or
        8 shots, the sixth with 8.
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
    electrons = undiminished = charge(exposure, sensor, drive.sensitivity)
    if power_w is not None:
        electrons = collect(exposure, sensor, power_w, drive.integration_s)
    raw = acquire(electrons, sensor, shots=shots, noise=noise, offsets=drive.offsets)
    noise_lsb = sample_noise_lsb(
        bank.gray(frames), problem.gray_exposure_s.take(frames), drive.integration_s, sensor
    )
    predicted_m = predict(problem, drive, frames, raw, noise_lsb)
    depth, valid = correct_and_weigh(
        raw,
        predicted_m,
        problem.description,
        merge=problem.config.merge,
        # Four samples of a frequency cancel the offset by themselves.
        offset_lsb=drive.offsets.calibrated_lsb if shots == Shots.TWO else None,
        noise_lsb=noise_lsb,
        shift_m=drive.drift_m,
    )
    scored = scored_pixels(undiminished, exposure.distance_m, problem)
    return Acquisition(raw, depth, valid, predicted_m, noise_lsb, exposure.distance_m, scored)


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


def scored_pixels(electrons: Electrons, truth_m: Tensor, problem: Problem) -> Tensor:
    """Pixels that count, 1 or 0: truth within the range, single-sample signal to noise enough."""
    sensor = problem.config.sensor
    strong = single_sample_snr(electrons, sensor).gt_(sensor.min_snr)
    # A comparison into float32 is vectorised; into a bool it is not.
    return torch.le(truth_m, sensor.max_range_m, out=torch.empty_like(truth_m)).mul_(strong)


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
    scored = score_maps(
        made.depth.distance_m,
        made.valid,
        made.truth_m,
        made.scored,
        error_scale_m=problem.config.reward.error_scale_m,
        unambiguous_m=unambiguous_range_m(problem.config.sensor.f1_hz),
    )
    sums = frame_sums(*scored, *seen_maps(made, shots))
    count, pixels = len(scored), problem.bank.height * problem.bank.width
    score = score_of(sums, problem.config.sensor.max_range_m)
    return Measured(score, seen_of(sums[count:], pixels))


def seen_maps(made: Acquisition, shots: Shots) -> list[Tensor]:
    """What the sensor can tell of each pixel without the truth, 4, 5 or 6 maps [B, H, W]."""
    amplitude, residual = made.depth.amplitude, made.depth.residual
    maps = [amplitude, _above_noise(amplitude, made.noise_lsb), made.valid, made.raw.saturation]
    if residual is not None:
        maps.append(_above_noise(residual, made.noise_lsb))
    if shots == Shots.EIGHT:
        apart_m = (made.depth.distance_m - made.predicted_m).abs_()
        maps.append((apart_m / (apart_m + 1.0)).mul_(made.valid))
    return maps


def seen_of(sums: Tensor, pixels: int) -> Tensor:
    """Features float32 [B, 4, 5 or 6] of the sums of `seen_maps` over frames of `pixels` pixels."""
    seen = sums / pixels
    seen[0].log1p_().div_(6.9)
    if len(sums) == len(SEEN_FEATURES):
        torch.div(sums[5], sums[2].clamp(min=1), out=seen[5])
    return seen.T.to(torch.float32)


def _above_noise(signal_lsb: Tensor, noise_lsb: Tensor) -> Tensor:
    """q / (q + 1), 0..1, where q is the signal over 4 sigma."""
    return signal_lsb / torch.add(signal_lsb, noise_lsb, alpha=4.0)
