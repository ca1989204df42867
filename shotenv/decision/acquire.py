"""One acquisition of the drives' current frames: light -> raw samples -> depth."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from shotenv.bank import WordBank
from shotenv.decision.drive import Drive
from shotenv.decision.problem import Problem
from shotenv.sensor import (
    acquire_prefixes,
    incident_light,
    noise_samples,
    sample_noise_lsb,
    scored_pixels,
    sensitivity,
)
from unwrap.depth import correct
from unwrap.signal import GRAY_FULL_SCALE, DepthFrame, RawFrame, Sensed, Shots, unambiguous_range_m


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
    truth_error_m : float32 [B, H, W] or None
        Expected error of a truth that was measured with the same samples; None of any other.
    """

    raw: RawFrame
    depth: DepthFrame
    predicted_m: Tensor
    noise_lsb: Tensor
    truth_m: Tensor
    scored: Tensor
    truth_error_m: Tensor | None = None


def noise_of(drive: Drive, step: Tensor, height: int, width: int) -> Iterator[Tensor]:
    """Normals [B, 2, H, W], sample after sample, of the frames at `step` [B].

    Each drive has its own.
    """
    # By the step and not the bank frame: a clip that comes twice in a drive is noisy anew.
    return noise_samples(drive.seed, step, height, width)


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

    See `acquire_depths`.
    """
    return acquire_depths(problem, drive, step, (shots,), power_w, noise=noise)[0]


def acquire_depths(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    counts: Sequence[Shots],
    power_w: Tensor | None = None,
    *,
    noise: Iterable[Tensor] | None = None,
) -> list[Acquisition]:
    """One acquisition of the frames at `step` [B] of `drive`, corrected from its first samples.

    Parameters
    ----------
    counts : sequence of Shots
        From how many samples; the most of them are taken, and the fewer are the first of these.
    power_w : float64 [B], optional
        What the laser emits while on, W; None is the drive's own power, not derated.
    noise : iterable of float32 [B, 2, H, W], optional
        Normals of each sample; None draws the drive's own. Recorded samples take none.

    Returns
    -------
    list of Acquisition
        In the order of `counts`.
    """
    bank, frames = problem.bank, drive.frame(step)
    if isinstance(bank, WordBank):
        taken, truth = recorded(problem, bank, drive, frames, counts)
    else:
        taken, truth = simulated(problem, drive, step, max(counts), power_w, noise)
    corrected = []
    for shots in counts:
        noise_lsb = told_noise_lsb(problem, drive, frames, shots)
        predicted_m = predict(problem, drive, frames, taken[shots], noise_lsb)
        depth = correct(
            taken[shots],
            predicted_m,
            problem.description,
            merge=problem.config.merge,
            eight=problem.config.eight,
            offset_lsb=offset_to_subtract_lsb(drive, shots),
            noise_lsb=noise_lsb,
            shift_m=drive.drift_m,
        )
        corrected.append(Acquisition(taken[shots], depth, predicted_m, noise_lsb, *truth))
    return corrected


def told_noise_lsb(problem: Problem, drive: Drive, frames: Tensor, shots: Shots) -> Tensor:
    """Noise of a sample among `shots` as the sensor itself expects it, float32 [B, H, W], LSB.

    By its gray image and, of two samples, its calibration.
    """
    return sample_noise_lsb(
        problem.bank.gray(frames),
        problem.gray_exposure_s.take(frames),
        drive.integration_s,
        problem.config.sensor,
        offset_left_lsb=drive.offset_left_lsb if shots == Shots.TWO else None,
    )


class Truth(NamedTuple):
    """What distances are scored against; fields of an `Acquisition`."""

    truth_m: Tensor
    scored: Tensor
    truth_error_m: Tensor | None = None


Taken = Mapping[Shots, RawFrame]


def simulated(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    most: Shots,
    power_w: Tensor | None,
    noise: Iterable[Tensor] | None,
) -> tuple[Taken, Truth]:
    """Samples of a bank's light, as many as `most` and fewer; see `acquire_depths`."""
    bank, sensor = problem.bank, problem.config.sensor
    exposure = bank.exposure(drive.frame(step))
    if noise is None:
        noise = noise_of(drive, step, bank.height, bank.width)
    # Which pixels count must not depend on the action, and derating follows from earlier ones.
    undiminished = light = incident_light(exposure, drive.sensitivity)
    if power_w is not None and drive.is_derated(power_w):
        light = incident_light(exposure, sensitivity(sensor, power_w, drive.integration_s))
    scored = scored_pixels(undiminished, exposure.distance_m, sensor)
    taken = acquire_prefixes(light, sensor, shots=most, noise=noise, offsets=drive.offsets)
    return taken, Truth(exposure.distance_m, scored)


def recorded(
    problem: Problem, bank: WordBank, drive: Drive, frames: Tensor, counts: Sequence[Shots]
) -> tuple[Taken, Truth]:
    """Samples as they were recorded: neither noise nor derating acts on them.

    Every pixel with a reference within the range counts.
    """
    level = bank.truth_level
    asked = {*counts, Shots.EIGHT} if level == "own" else set(counts)
    taken = {shots: bank.words(frames, shots) for shots in sorted(asked, reverse=True)}
    error_m = None
    if level == "external":
        truth_m = bank.distance_m(frames)
    elif level == "own":
        truth_m, error_m = own_reference(problem, drive, frames, taken[Shots.EIGHT])
    else:
        truth_m = torch.full((len(frames), bank.height, bank.width), torch.nan)
    return taken, Truth(truth_m, truth_m <= problem.config.sensor.max_range_m, error_m)


def own_reference(
    problem: Problem, drive: Drive, frames: Tensor, eight: RawFrame
) -> tuple[Tensor, Tensor]:
    """Depth of eight samples without any network, and its expected error, both [B, H, W], metres.

    NaN where a frequency is weak, a pixel saturated, or the two disagree. Noise n of a sample turns
    the phase of four, of amplitude A, by n / (sqrt(2) A); both frequencies together measure f1 and
    f2 with weights f^2, and a normal error is sqrt(2 / pi) of its standard deviation in the mean.
    """
    noise_lsb = told_noise_lsb(problem, drive, frames, Shots.EIGHT)
    sensor = problem.description
    depth = correct(eight, None, sensor, noise_lsb=noise_lsb, shift_m=drive.drift_m)
    m_per_rad = unambiguous_range_m(sensor.f1_hz) / (2 * math.pi)
    fused = sensor.f1_hz / math.hypot(sensor.f1_hz, sensor.f2_hz)
    spread_m = m_per_rad * fused * noise_lsb / (math.sqrt(2) * depth.amplitude)
    return depth.distance_m, math.sqrt(2 / math.pi) * spread_m


def offset_to_subtract_lsb(drive: Drive, shots: Shots) -> Tensor | None:
    """The calibrated dark offset [B, H, W] where it is subtracted from samples: with 2 DCS only.

    Four samples of a frequency come in pairs half a period apart, whose differences D0 - D2 and
    D1 - D3 hold no offset. Two samples have no partner, so the stored map must do, and what it
    does not know (temperature, ambient light) stays in the phase.
    """
    return drive.offsets.calibrated_lsb if shots == Shots.TWO else None


def predict(
    problem: Problem, drive: Drive, frames: Tensor, raw: RawFrame, noise_lsb: Tensor
) -> Tensor:
    """The network's distance float32 [B, H, W] of the bank frames `frames` [B].

    Looked up where the gray image is all that the network takes; else predicted from the samples
    `raw`, which have the noise `noise_lsb` [B, H, W]. A network that has a memory starts without
    one in every frame, so that an outcome depends on the drive, the frame and the shots alone.
    """
    if problem.fusion is None:
        return problem.kept.distance_of(frames)
    sensed = Sensed(
        gray=problem.bank.gray(frames).to(torch.float32) / GRAY_FULL_SCALE,
        raw=raw,
        # Networks are trained with the stored map beside the samples, whatever their number.
        offset_lsb=drive.offsets.calibrated_lsb,
        noise_lsb=noise_lsb,
        shift_m=drive.drift_m,
    )
    return problem.fusion.predict_sensed(sensed, problem.description).distance_m
