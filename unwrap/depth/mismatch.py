"""Wrap hypotheses of two frequencies, weighed by the mismatch of their phases.

Twice, and a test holds both together: a chain of torch operations, for any device and for
gradients, which is the reference, and a compiled loop, which processors use.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.depth.candidates import candidates_m
from unwrap.signal import (
    TWO_PI,
    PhaseFrame,
    SensorDescription,
    distance_m,
    unambiguous_range_m,
)
from unwrap.support import array, array_of, can_loop, loop

Array = np.ndarray
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, HALF, ONE, INFINITE = map(np.float32, (0.0, 0.5, 1.0, np.inf))
LEAST_AMPLITUDE = np.float32(1e-6)
"""Pixels without signal count as this strong: their variance is to be large, not infinite."""


class MismatchModel(NamedTuple):
    """Constants of `hypotheses`, float32 for loops.

    Attributes
    ----------
    range1_m, range2_m
        Unambiguous ranges.
    farthest_m
        Candidates beyond it have no weight.
    m_per_rad1, m_per_rad2
        Distance of a phase.
    systematic_m2
        Variance of the mismatch that noise does not explain.
    mismatch_scale, phase_scale_rad2
        See `unwrap.depth.kernel_density.KernelDensity`.
    share2
        Of f2 in the fused distance: by inverse variance, which goes with f^2, as in `unwrap_dual`.
    """

    range1_m: float
    range2_m: float
    farthest_m: float
    m_per_rad1: float
    m_per_rad2: float
    systematic_m2: float
    mismatch_scale: float
    phase_scale_rad2: float
    share2: float

    @classmethod
    def of(
        cls,
        sensor: SensorDescription,
        *,
        systematic_m: float,
        mismatch_scale: float,
        phase_scale_rad2: float,
    ) -> MismatchModel:
        """For a sensor's frequencies."""
        range1_m, range2_m = (unambiguous_range_m(hz) for hz in (sensor.f1_hz, sensor.f2_hz))
        return cls(
            range1_m,
            range2_m,
            sensor.max_range_m,
            range1_m / TWO_PI,
            range2_m / TWO_PI,
            systematic_m**2,
            mismatch_scale,
            phase_scale_rad2,
            sensor.f2_hz**2 / (sensor.f1_hz**2 + sensor.f2_hz**2),
        )


def hypotheses(
    first: PhaseFrame,
    second: PhaseFrame,
    sensor: SensorDescription,
    noise: Tensor | float,
    model: MismatchModel,
    most: int,
) -> tuple[Tensor, Tensor]:
    """The `most` likeliest distances and their weights, both [B, I, H, W], likeliest first.

    Fewer than `most` where the range has fewer wraps.
    """
    count = math.floor(sensor.max_range_m / model.range1_m) + 1
    kept = min(most, count)
    maps = (first.phase_rad, second.phase_rad, first.amplitude, second.amplitude)
    if not can_loop(*maps):
        return hypotheses_by_torch(first, second, sensor, noise, model, kept)
    batch, height, width = first.phase_rad.shape
    depth_m, cost = torch.empty(2, batch, kept, height, width).unbind()
    rank_candidates(
        array(first.phase_rad),
        array(second.phase_rad),
        array(first.amplitude),
        array(second.amplitude),
        array_of(noise, first.phase_rad.shape),
        MismatchModel._make(map(np.float32, model)),
        count,
        array(depth_m),
        array(cost),
    )
    return depth_m, cost.mul_(-0.5).exp_()


def hypotheses_by_torch(
    first: PhaseFrame,
    second: PhaseFrame,
    sensor: SensorDescription,
    noise: Tensor | float,
    model: MismatchModel,
    kept: int,
) -> tuple[Tensor, Tensor]:
    """Reference of `rank_candidates`, and what becomes of the costs."""
    # Each candidate of f1 with its nearest one of f2: what rounding leaves is their mismatch.
    first_m = candidates_m(first.phase_rad, sensor.f1_hz, sensor.max_range_m)
    second_m = distance_m(second.phase_rad, sensor.f2_hz).unsqueeze(1)
    gap = (first_m - second_m) / model.range2_m
    mismatch_m = (gap - gap.round()) * model.range2_m
    # Four samples: the variance of the phase is (noise / A)^2 / 2.
    variance1, variance2 = (
        (noise / frame.amplitude.clamp(min=float(LEAST_AMPLITUDE))).square().unsqueeze(1) / 2
        for frame in (first, second)
    )
    variance_m2 = model.m_per_rad1**2 * variance1 + model.m_per_rad2**2 * variance2
    scale_m2 = model.mismatch_scale * (variance_m2 + model.systematic_m2)
    unsure = (variance1 + variance2) / model.phase_scale_rad2
    cost = mismatch_m.square() / scale_m2 + unsure
    cost = cost.where(first_m <= model.farthest_m, torch.inf)
    fused_m = (first_m - model.share2 * mismatch_m).clamp(min=0)
    # Sorted by cost, and not by weight, which is 0 for all that is unlikely.
    cost, order = cost.sort(dim=1, stable=True)
    return fused_m.gather(1, order[:, :kept]), cost[:, :kept].mul(-0.5).exp()


@loop
def rank_candidates(
    phase1_rad: Array,
    phase2_rad: Array,
    amplitude1: Array,
    amplitude2: Array,
    noise: Array,
    model: MismatchModel,
    count: int,
    depth_m: Array,
    cost: Array,
) -> None:
    """The best of `count` wrap candidates of each pixel, by the mismatch of its two frequencies.

    Parameters
    ----------
    phase1_rad, phase2_rad, amplitude1, amplitude2, noise : float32 [B, H, W]
    depth_m, cost : float32 [B, I, H, W]
        Fused distance, and -2 times the logarithm of the weight, infinite beyond the range; are
        written, the least cost first, of equals the nearest.
    """
    frames, kept, rows, columns = depth_m.shape
    scale_m2, unsure, mismatch_m = np.empty((3, columns), np.float32)
    fused_m = np.empty((count, columns), np.float32)
    costs = np.empty((count, columns), np.float32)
    ranks = np.empty((count, columns), np.float32)
    squared1, squared2 = model.m_per_rad1 * model.m_per_rad1, model.m_per_rad2 * model.m_per_rad2
    # Loops over a row without branches take many pixels at once. They are short because the
    # compiler gives up on loops of more than a few arrays, which might overlap.
    for b in range(frames):
        for i in range(rows):
            phase1, phase2, deviation = phase1_rad[b, i], phase2_rad[b, i], noise[b, i]
            signal1, signal2 = amplitude1[b, i], amplitude2[b, i]
            for j in range(columns):
                ratio1 = deviation[j] / max(signal1[j], LEAST_AMPLITUDE)
                ratio2 = deviation[j] / max(signal2[j], LEAST_AMPLITUDE)
                variance1, variance2 = ratio1 * ratio1 * HALF, ratio2 * ratio2 * HALF
                variance_m2 = squared1 * variance1 + squared2 * variance2
                scale_m2[j] = model.mismatch_scale * (variance_m2 + model.systematic_m2)
                unsure[j] = (variance1 + variance2) / model.phase_scale_rad2
            for n in range(count):
                wraps_m, fused, penalty = np.float32(n) * model.range1_m, fused_m[n], costs[n]
                for j in range(columns):
                    first_m = phase1[j] * model.m_per_rad1 + wraps_m
                    gap = (first_m - phase2[j] * model.m_per_rad2) / model.range2_m
                    mismatch_m[j] = (gap - np.rint(gap)) * model.range2_m
                for j in range(columns):
                    first_m = phase1[j] * model.m_per_rad1 + wraps_m
                    fused[j] = max(first_m - model.share2 * mismatch_m[j], ZERO)
                for j in range(columns):
                    first_m = phase1[j] * model.m_per_rad1 + wraps_m
                    whole = mismatch_m[j] * mismatch_m[j] / scale_m2[j] + unsure[j]
                    penalty[j] = whole if first_m <= model.farthest_m else INFINITE
            # The rank of a candidate is the number of those that go before it.
            ranks[:] = ZERO
            for n in range(count):
                for m in range(n):
                    earlier, later, before, after = costs[m], costs[n], ranks[m], ranks[n]
                    for j in range(columns):
                        swapped = later[j] < earlier[j]
                        before[j] += ONE if swapped else ZERO
                        after[j] += ZERO if swapped else ONE
            for h in range(kept):
                best_m, least = depth_m[b, h, i], cost[b, h, i]
                place = np.float32(h)
                best_m[:], least[:] = ZERO, INFINITE
                for n in range(count):
                    fused, penalty, rank = fused_m[n], costs[n], ranks[n]
                    for j in range(columns):
                        other_m, this_m, other, this = best_m[j], fused[j], least[j], penalty[j]
                        here = rank[j] == place
                        best_m[j] = this_m if here else other_m
                        least[j] = this if here else other
