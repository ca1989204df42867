"""One acquisition of the drives' current frames: light -> raw samples -> depth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.bank import WordBank
from shotenv.config import SensorConfig
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
from unwrap.signal import GRAY_FULL_SCALE, DepthFrame, RawFrame, Sensed, Shots


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
    bank, sensor, frames = problem.bank, problem.config.sensor, drive.frame(step)
    gray = bank.gray(frames)
    if isinstance(bank, WordBank):
        taken, truth_m, scored = recorded(bank, frames, counts, sensor)
    else:
        taken, truth_m, scored = simulated(problem, drive, step, max(counts), power_w, noise)
    corrected = []
    for shots in counts:
        # As the sensor itself expects it, from its gray image and, of two samples, its calibration.
        noise_lsb = sample_noise_lsb(
            gray,
            problem.gray_exposure_s.take(frames),
            drive.integration_s,
            sensor,
            offset_left_lsb=drive.offset_left_lsb if shots == Shots.TWO else None,
        )
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
        corrected.append(Acquisition(taken[shots], depth, predicted_m, noise_lsb, truth_m, scored))
    return corrected


Taken = tuple[Mapping[Shots, RawFrame], Tensor, Tensor]
"""Samples of each number of them, truth float32 [B, H, W], and where it counts, bool [B, H, W]."""


def simulated(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    most: Shots,
    power_w: Tensor | None,
    noise: Iterable[Tensor] | None,
) -> Taken:
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
    return taken, exposure.distance_m, scored


def recorded(
    bank: WordBank, frames: Tensor, counts: Sequence[Shots], sensor: SensorConfig
) -> Taken:
    """Samples as they were recorded: neither noise nor derating acts on them.

    Every pixel with a reference within the range counts.
    """
    taken = {shots: bank.words(frames, shots) for shots in sorted(counts, reverse=True)}
    truth_m = bank.distance_m(frames)
    return taken, truth_m, truth_m <= sensor.max_range_m


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
