"""What an acquisition is worth: its score against the truth, and what the sensor can tell."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from shotenv.decision.acquire import Acquisition, acquire_depths
from shotenv.decision.drive import Drive
from shotenv.decision.features import SEEN_FEATURES, TOLD, Sums, evaluated
from shotenv.decision.problem import Problem
from shotenv.decision.score import DepthScore, no_depth, score_depth
from shotenv.decision.state import State
from unwrap.signal import Shots
from unwrap.support import array, loop, put, take

Array = np.ndarray
# One Python float among them would make the arithmetic of the loops float64.
ZERO, FOUR_SIGMA = np.float32(0.0), np.float32(4.0)


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
    *,
    noise: Sequence[Tensor] | None = None,
) -> Measurement:
    """Acquire, correct and score the frames at `step` [B] of `drive`; see `acquire_depths`.

    Parameters
    ----------
    shots : Shots or int64 [B]
        Of all frames, or of each: 2, 4 or 8. All frames take the most samples that one of them
        needs, so that those of 8 are better measured by themselves; see `measure_by_shots`.
    """
    # Counts that are asked for, the most first.
    each = torch.full_like(step, int(shots)) if isinstance(shots, Shots) else shots
    most, *fewer = sorted(map(Shots, set(each.tolist())), reverse=True)
    # Of two samples the reference needs two more, which are taken for it alone.
    counts = [n for n in Shots if n <= max(most, Shots.FOUR)]
    acquired = acquire_depths(problem, drive, step, counts, power_w, noise=noise)
    reference = acquired[counts.index(Shots.FOUR)]
    if power_w is not None and drive.is_derated(power_w):
        (reference,) = acquire_depths(problem, drive, step, (Shots.FOUR,), noise=noise)
    scores = {counts[place]: score_of(problem, one) for place, one in enumerate(acquired)}
    derated = reference is not acquired[counts.index(Shots.FOUR)]
    error_of_four = score_of(problem, reference).error if derated else scores[Shots.FOUR].error

    def measured(count: Shots) -> Measurement:
        taken = acquired[: counts.index(count) + 1]
        return Measurement(scores[count], error_of_four, told_by(problem, taken))

    found = measured(most)
    for count in fewer:
        rows = (each == count).nonzero().squeeze(1)
        found = put(found, rows, take(measured(count), rows))
    return found


def measure_prefixes(
    problem: Problem, drive: Drive, step: Tensor, *, noise: Sequence[Tensor] | None = None
) -> list[Measurement]:
    """As `measure_frames` of 2, 4 and 8 samples, from one acquisition of 8."""
    acquired = acquire_depths(problem, drive, step, tuple(Shots), noise=noise)
    scores = [score_of(problem, one) for one in acquired]
    error_of_four = scores[Shots.FOUR.action].error
    return [
        Measurement(score, error_of_four, told_by(problem, acquired[: place + 1]))
        for place, score in enumerate(scores)
    ]


def score_of(problem: Problem, acquisition: Acquisition) -> DepthScore:
    """Score over the pixels that the drive's own laser lights enough, whatever is emitted now."""
    return score_depth(
        acquisition.depth.distance_m,
        acquisition.depth.valid,
        acquisition.truth_m,
        acquisition.scored,
        error_scale_m=problem.config.reward.error_scale_m,
        unambiguous_m=acquisition.depth.unambiguous_m,
        range_m=problem.config.sensor.max_range_m,
    )


def told_by(problem: Problem, taken: Sequence[Acquisition]) -> Tensor:
    """`SEEN_FEATURES` of an acquisition, the last of `taken`, which holds the shorter ones too."""
    return evaluated(SEEN_FEATURES, sums_of(taken, problem.config.reward.error_scale_m))


def measure_by_shots(
    problem: Problem, state: State, shots: Tensor, power_w: Tensor, measure: Measure
) -> Measurement:
    """Measure the frame of every drive with its own number of samples.

    Drives of 2 and 4 samples are one batch, those of 8 another. A feature that these samples cannot tell stays
    as an earlier frame told it: after 8, then 2 DCS, `regret_of_two` is that of the 8.

    Parameters
    ----------
    shots : int64 [B]
        0, 2, 4 or 8; with 0 there is no depth.
    power_w : float64 [B]
        What each laser emits while on, W.
    """
    drive, step, before = state.drive, state.step, state.seen.features
    # Frames of 2 and of 4 samples both take 4, for the reward's reference.
    drawn = shots.clamp(min=int(Shots.FOUR)).masked_fill_(shots == 0, 0)
    counts = set(drawn.tolist())
    if len(counts) == 1 and 0 not in counts:
        # The whole batch as it is: picking rows would copy the offsets of every pixel.
        found = measure(problem, drive, step, shots, power_w)
    else:
        lost = no_depth(len(shots), problem.config.sensor.max_range_m)
        found = Measurement(lost, torch.zeros_like(lost.error), before)
        for count in sorted(counts):
            rows = (drawn == count).nonzero().squeeze(1)
            part_drive, part_step = take(drive, rows), step[rows]
            if count:
                part = measure(problem, part_drive, part_step, shots[rows], power_w[rows])
            else:
                # Nothing is measured; the reference is that of a laser which works.
                fours = torch.full_like(part_step, int(Shots.FOUR))
                four = measure(problem, part_drive, part_step, fours, None)
                part = Measurement(
                    take(lost, rows), four.error_of_four, before.index_select(0, rows)
                )
            found = put(found, rows, part)
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
        array(depth.amplitude),
        # With two samples there is none; what is made of it is then not told.
        array(depth.amplitude if depth.residual is None else depth.residual),
        array(whole.noise_lsb),
        array(depth.valid, np.bool_),
        array(whole.raw.saturated, np.bool_),
        array(depth.distance_m),
        array(two),
        array(four),
        np.float32(error_scale_m),
        sums,
    )
    pixels = depth.valid.shape[1] * depth.valid.shape[2]
    counted = torch.from_numpy(sums)
    return Sums(torch.full_like(counted[0], pixels), *counted.unbind())


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
    """Write the fields of `Sums` but the pixels into `found`, float64 [8, B], of maps [B, H, W].

    Sums go column by column first, as those of scores do.
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
