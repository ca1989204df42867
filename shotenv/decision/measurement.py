"""What an acquisition is worth: its score against the truth, and what the sensor can tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import torch
from torch import Tensor

from shotenv.bank import WordBank
from shotenv.config import EnvConfig
from shotenv.decision.acquire import Acquisition, acquire_depths
from shotenv.decision.drive import Drive
from shotenv.decision.features import SEEN_FEATURES, TOLD, Sums, evaluated
from shotenv.decision.frame_loop import Chain, FramesTaken, room_for, score_frames_
from shotenv.decision.problem import Problem
from shotenv.decision.score import (
    SCORES,
    SUMMED,
    DepthScore,
    error_beside,
    no_depth,
    score_depth,
    sum_pixels_,
    unscored,
)
from shotenv.decision.state import State
from shotenv.sensor import gray_noise, incident_light, pixel_of, row_parity, sensitivity
from unwrap.depth import RULES, dual_limits, merge_limits, shift_in_turns, turns_table
from unwrap.signal import SensorDescription, Shots, unambiguous_range_m
from unwrap.support import array, in_parts, long_rows, mapped, put, take

Array = np.ndarray
THREAD_PIXELS = 4096
"""Fewest pixels that are worth a thread of their own: some 0.2 ms of work."""


@dataclass(frozen=True)
class Measurement:
    """What is known after an acquisition; batch B.

    Attributes
    ----------
    score : DepthScore
        Against the truth; pays the reward.
    error_of_four : float64 [B]
        Error term that 4 DCS bring in the same frames, with the same noise and an undiminished
        laser: the reward's reference, whatever was taken.
    features : float32 [B, len(SEEN_FEATURES)]
        What the sensor itself can tell; only the features `TOLD` by the shots mean something.
    """

    score: DepthScore
    error_of_four: Tensor
    features: Tensor


Measure = Callable[[Problem, Drive, Tensor, Tensor, Tensor | None], Measurement]
"""`measure_frames`, or what gives the same numbers faster (`MeasurementCache`)."""


def measure_frames(
    problem: Problem,
    drive: Drive,
    step: Tensor,
    shots: Shots | Tensor,
    power_w: Tensor | None = None,
) -> Measurement:
    """Acquire, correct and score the frames at `step` [B] of `drive`; see `acquire_depths`.

    Parameters
    ----------
    shots : Shots or int64 [B]
        Of all frames, or of each: 0, 2, 4 or 8; with 0 there is no depth.
    power_w : float64 [B], optional
        What each laser emits while on, W; None is the drive's own power, not derated.
    """
    each = torch.full_like(step, int(shots)) if isinstance(shots, Shots) else shots
    power_w = drive.laser_power_w if power_w is None else power_w
    # Networks that look at samples, and votes of neighbours, need whole maps of the batch; of
    # recorded samples the loop, which begins with light, could take no part.
    by_maps = problem.fusion is not None or problem.config.eight == "kernel_density"
    if not by_maps and not isinstance(problem.bank, WordBank):
        return _measured_by_loop(problem, drive, step, each, power_w)
    return _measured_by_maps(problem, drive, step, each, power_w)


def _measured_by_loop(
    problem: Problem, drive: Drive, step: Tensor, shots: Tensor, power_w: Tensor
) -> Measurement:
    """By one compiled loop, frame by frame."""
    config, bank, frames = problem.config, problem.bank, drive.frame(step)
    sensor, exposure = config.sensor, bank.exposure(frames)
    light = incident_light(exposure, drive.sensitivity)
    gray_s = problem.gray_exposure_s.take(frames)
    known = gray_noise(gray_s, drive.integration_s, sensor, offset_left_lsb=drive.offset_left_lsb)
    # Of more than two samples the offsets cancel.
    none = np.zeros(len(step), np.float32)
    emitted_e = light.active_e
    if drive.is_derated(power_w):
        emitted_e = array(sensitivity(sensor, power_w, drive.integration_s).active_e)

    def rows(maps: Tensor, dtype: type | None = np.float32) -> Array:
        return long_rows(array(maps, dtype), SUMMED)

    taken = FramesTaken(
        shots=shots.numpy(),
        seeds=drive.seed.numpy(),
        steps=step.numpy(),
        light=light._replace(
            correlation=rows(exposure.correlation),
            active=rows(exposure.active),
            ambient=rows(exposure.ambient),
        ),
        emitted_e=emitted_e,
        truth_m=rows(exposure.distance_m),
        gray=rows(bank.gray(frames), None),
        predicted_m=rows(problem.kept.distance_of(frames)),
        pattern_lsb=rows(drive.offsets.pattern_lsb),
        calibrated_lsb=rows(drive.offsets.calibrated_lsb),
        noise_of_two=known,
        noise_of_more=known._replace(offset_variance=none, offset_per_word=none),
        shift1=shift_in_turns(0, problem.description, drive.drift_m, len(step)),
        shift2=shift_in_turns(1, problem.description, drive.drift_m, len(step)),
    )
    sizes = (len(SCORES),), (), (8,)
    score, error_of_four, sums = (np.zeros((*size, len(step))) for size in sizes)
    chain, (rows_, columns) = chain_of(problem), taken.truth_m.shape[1:]
    finite = in_parts(
        lambda begin, end: score_frames_(
            begin, end, taken, chain, room_for(rows_, columns), score, error_of_four, sums
        ),
        len(step),
        least=1 + THREAD_PIXELS // (bank.height * bank.width),
    )
    if not all(finite):
        raise ValueError(f"bank {bank.name} holds light that is NaN or infinite; render it again")
    counted = torch.from_numpy(sums)
    pixels = torch.full_like(counted[0], bank.height * bank.width)
    found = DepthScore(*torch.from_numpy(score).unbind())
    if not shots.all():
        lost = no_depth(len(step), sensor.max_range_m)
        found = mapped(lambda one, other: torch.where(shots > 0, one, other), found, lost)
    return Measurement(
        found,
        torch.from_numpy(error_of_four),
        evaluated(SEEN_FEATURES, Sums(pixels, *counted.unbind())),
    )


@lru_cache(maxsize=4)
def _chain(config: EnvConfig, description: SensorDescription, height: int, width: int) -> Chain:
    sensor = config.sensor
    unambiguous_m = unambiguous_range_m(description.f1_hz)
    return Chain(
        parity=long_rows(row_parity(height, width), SUMMED),
        pixel=pixel_of(sensor),
        range_m=np.float32(sensor.max_range_m),
        min_snr=np.float32(sensor.min_snr),
        table1=turns_table(0, description),
        table2=turns_table(1, description),
        limits=merge_limits(description),
        branch=RULES[config.merge].branch,
        dual=dual_limits(description),
        fuses=config.eight == "two_frequency",
        scale_m=np.float32(config.reward.error_scale_m),
        near_m=np.float32(0.5 * unambiguous_m),
        worst_m=float(sensor.max_range_m),
    )


def chain_of(problem: Problem) -> Chain:
    """Constants of a problem's loop; kept, for every step asks."""
    return _chain(problem.config, problem.description, problem.bank.height, problem.bank.width)


def _measured_by_maps(
    problem: Problem, drive: Drive, step: Tensor, shots: Tensor, power_w: Tensor
) -> Measurement:
    """Map by map; drives that take the same number of samples are one batch."""
    lost = lost_depth(problem, len(shots))
    unseen = torch.zeros(len(shots), len(SEEN_FEATURES))
    found = Measurement(lost, torch.zeros_like(lost.error), unseen)
    # Where nothing is scored there is no reference, and a frame without laser is not taken at all.
    idle = {0} if problem.bank.truth_level == "none" else set()
    for count in sorted(set(shots.tolist()) - idle):
        rows = (shots == count).nonzero().squeeze(1)
        part_drive, part_step = take(drive, rows), step[rows]
        # Nothing is measured without laser; the reference is that of one that works.
        own_w = power_w[rows] if count else part_drive.laser_power_w
        part = _measured_alike(problem, part_drive, part_step, Shots(count or 4), own_w)
        if not count:
            part = Measurement(take(lost, rows), part.error_of_four, take(unseen, rows))
        found = put(found, rows, part)
    return found


def _measured_alike(
    problem: Problem, drive: Drive, step: Tensor, shots: Shots, power_w: Tensor
) -> Measurement:
    # Of two samples the reference needs two more, which are taken for it alone.
    scored = problem.bank.truth_level != "none"
    counts = [n for n in Shots if n <= (max(shots, Shots.FOUR) if scored else shots)]
    acquired = acquire_depths(problem, drive, step, counts, power_w)
    taken = acquired[: counts.index(shots) + 1]
    if not scored:
        nothing = lost_depth(problem, len(step))
        return Measurement(nothing, nothing.error, told_by(problem, taken))
    reference = acquired[counts.index(Shots.FOUR)]
    if drive.is_derated(power_w) and not isinstance(problem.bank, WordBank):
        (reference,) = acquire_depths(problem, drive, step, (Shots.FOUR,))
    return Measurement(
        score_of(problem, taken[-1]),
        score_of(problem, reference).error,
        told_by(problem, taken),
    )


def lost_depth(problem: Problem, batch: int) -> DepthScore:
    """Score of frames without laser: full error, or none where no depth is scored."""
    if problem.bank.truth_level == "none":
        return unscored(batch)
    return no_depth(batch, problem.config.sensor.max_range_m)


def score_of(problem: Problem, acquisition: Acquisition) -> DepthScore:
    """Score over the pixels that the drive's own laser lights enough, whatever is emitted now.

    Against a truth that eight samples have measured themselves, its expected error adds to that of
    all acquisitions, and those eight samples have no other.
    """
    depth, scale_m = acquisition.depth, problem.config.reward.error_scale_m
    score = score_depth(
        depth.distance_m,
        depth.valid,
        acquisition.truth_m,
        acquisition.scored,
        error_scale_m=scale_m,
        unambiguous_m=depth.unambiguous_m,
        range_m=problem.config.sensor.max_range_m,
    )
    if acquisition.truth_error_m is None:
        return score
    is_truth = acquisition.raw.shots == Shots.EIGHT
    apart_m = (depth.distance_m - acquisition.truth_m).abs()
    error = error_beside(
        torch.zeros_like(apart_m) if is_truth else apart_m,
        acquisition.truth_error_m,
        acquisition.scored,
        scale_m,
    )
    return replace(unscored(len(error)) if is_truth else score, error=error)


def told_by(problem: Problem, taken: Sequence[Acquisition]) -> Tensor:
    """`SEEN_FEATURES` of an acquisition, the last of `taken`, which holds the shorter ones too."""
    return evaluated(SEEN_FEATURES, sums_of(taken, problem.config.reward.error_scale_m))


def measure_by_shots(
    problem: Problem, state: State, shots: Tensor, power_w: Tensor, measure: Measure
) -> Measurement:
    """Measure the frame of every drive with its own number of samples.

    A feature that these samples cannot tell stays
    as an earlier frame told it: after 8, then 2 DCS, `regret_of_two` is that of the 8.

    Parameters
    ----------
    shots : int64 [B]
        0, 2, 4 or 8; with 0 there is no depth.
    power_w : float64 [B]
        What each laser emits while on, W.
    """
    before = state.seen.features
    found = measure(problem, state.drive, state.step, shots, power_w)
    features = torch.where(TOLD.index_select(0, shots), found.features, before)
    return Measurement(found.score, found.error_of_four, features)


def sums_of(taken: Sequence[Acquisition], error_scale_m: float) -> Sums:
    """What the pixels of an acquisition tell without the truth, summed over each frame.

    Parameters
    ----------
    taken : sequence of Acquisition
        Of the first 2, the first 4 and all samples, as far as there are so many; the last is all.
    error_scale_m : float
        Of the reward's error term, in which regret is measured.
    """
    whole, depth = taken[-1], taken[-1].depth
    sums = np.empty((8, len(depth.distance_m)))
    # Where there are no fewer samples, an acquisition stands for itself, and regrets nothing.
    two, four = (taken[min(place, len(taken) - 1)].depth.distance_m for place in (0, 1))
    sum_pixels_(
        long_rows(array(depth.amplitude), SUMMED),
        # With two samples there is none; what is made of it is then not told.
        long_rows(array(depth.amplitude if depth.residual is None else depth.residual), SUMMED),
        long_rows(array(whole.noise_lsb), SUMMED),
        long_rows(array(depth.valid, np.bool_), SUMMED),
        long_rows(array(whole.raw.saturated, np.bool_), SUMMED),
        long_rows(array(depth.distance_m), SUMMED),
        long_rows(array(two), SUMMED),
        long_rows(array(four), SUMMED),
        np.float32(error_scale_m),
        sums,
    )
    pixels = depth.valid.shape[1] * depth.valid.shape[2]
    counted = torch.from_numpy(sums)
    return Sums(torch.full_like(counted[0], pixels), *counted.unbind())
