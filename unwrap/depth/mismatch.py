"""Wrap hypotheses of one to three frequencies, weighed by the mismatch of their phases.

Twice, and a test holds both together: a chain of torch operations, for any device and for
gradients, which is the reference, and a compiled loop, which processors use.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor

from unwrap.depth.multi_frequency import fusing_shares
from unwrap.signal import TWO_PI, PhaseFrame, unambiguous_range_m
from unwrap.support import array_of, can_loop, loop

Array = np.ndarray
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, HALF, ONE, INFINITE = map(np.float32, (0.0, 0.5, 1.0, np.inf))
LEAST_AMPLITUDE = np.float32(1e-6)
"""Pixels without signal count as this strong: their variance is to be large, not infinite."""


class MismatchModel(NamedTuple):
    """Constants of `hypotheses`; in loops float32, and float32 [K] where there is one of each.

    Attributes
    ----------
    ranges_m : K floats
        Unambiguous ranges.
    m_per_rad : K floats
        Distances of a phase.
    shares : K floats
        Of each frequency as it is fused with those before it, see `fusing_shares`.
    farthest_m
        Candidates beyond it have no weight.
    systematic_m2
        Variance of the mismatch that noise does not explain.
    mismatch_scale, phase_scale_rad2
        See `unwrap.depth.kernel_density.KernelDensity`.
    """

    ranges_m: tuple[float, ...]
    m_per_rad: tuple[float, ...]
    shares: tuple[float, ...]
    farthest_m: float
    systematic_m2: float
    mismatch_scale: float
    phase_scale_rad2: float

    @classmethod
    def of(
        cls,
        frequencies_hz: Sequence[float],
        max_range_m: float,
        *,
        systematic_m: float,
        mismatch_scale: float,
        phase_scale_rad2: float,
    ) -> MismatchModel:
        """For one to three frequencies."""
        ranges_m = tuple(map(unambiguous_range_m, frequencies_hz))
        return cls(
            ranges_m,
            tuple(range_m / TWO_PI for range_m in ranges_m),
            fusing_shares(frequencies_hz),
            max_range_m,
            systematic_m**2,
            mismatch_scale,
            phase_scale_rad2,
        )

    @property
    def wraps(self) -> int:
        """Wrap candidates of a pixel: those that begin within the range, of one frequency one."""
        # One phase has no mismatch: nothing would tell the wraps apart.
        one = len(self.ranges_m) == 1
        return 1 if one else math.floor(self.farthest_m / self.ranges_m[0]) + 1


def hypotheses(
    frames: Sequence[PhaseFrame], noise: Tensor | float, model: MismatchModel, most: int
) -> tuple[Tensor, Tensor]:
    """The `most` likeliest distances and their weights, both [B, I, H, W], likeliest first.

    Fewer than `most` where the range has fewer wraps.

    Parameters
    ----------
    frames : K of PhaseFrame [B, H, W]
        At the frequencies of `model`.
    """
    kept = min(most, model.wraps)
    if not can_loop(*(part for one in frames for part in (one.phase_rad, one.amplitude))):
        return hypotheses_by_torch(frames, noise, model, kept)
    batch, height, width = frames[0].phase_rad.shape
    constants: Iterable[Any] = model  # Numbers, and tuples, which become arrays.
    depth_m, cost = torch.empty(2, batch, kept, height, width).unbind()
    rank_candidates(
        torch.stack([one.phase_rad for one in frames]).numpy(),
        torch.stack([one.amplitude for one in frames]).numpy(),
        array_of(noise, frames[0].phase_rad.shape),
        MismatchModel._make(map(np.float32, constants)),
        model.wraps,
        depth_m.numpy(),
        cost.numpy(),
    )
    return depth_m, cost.mul_(-0.5).exp_()


def hypotheses_by_torch(
    frames: Sequence[PhaseFrame], noise: Tensor | float, model: MismatchModel, kept: int
) -> tuple[Tensor, Tensor]:
    """Reference of `rank_candidates`, and what becomes of the costs."""
    wraps = torch.arange(model.wraps, device=frames[0].phase_rad.device).view(-1, 1, 1)
    first_m = (frames[0].phase_rad * model.m_per_rad[0]).unsqueeze(1) + wraps * model.ranges_m[0]
    # Four samples: the variance of the phase is (noise / A)^2 / 2.
    variances = [
        (noise / one.amplitude.clamp(min=float(LEAST_AMPLITUDE))).square().unsqueeze(1) / 2
        for one in frames
    ]
    fused_m, cost = first_m, torch.zeros_like(first_m)
    fused_m2 = model.m_per_rad[0] ** 2 * variances[0]
    for k in range(1, len(frames)):
        # Each candidate with the nearest one of f_k: what rounding leaves is their mismatch.
        own_m = (frames[k].phase_rad * model.m_per_rad[k]).unsqueeze(1)
        gap = (fused_m - own_m) / model.ranges_m[k]
        mismatch_m = (gap - gap.round()) * model.ranges_m[k]
        own_m2, share = model.m_per_rad[k] ** 2 * variances[k], model.shares[k]
        scale_m2 = model.mismatch_scale * (fused_m2 + own_m2 + model.systematic_m2)
        cost = cost + mismatch_m.square() / scale_m2
        fused_m = fused_m - share * mismatch_m
        fused_m2 = (1 - share) ** 2 * fused_m2 + share**2 * own_m2
    cost = cost + sum(variances) / model.phase_scale_rad2
    if len(frames) > 1:
        cost = cost.where(first_m <= model.farthest_m, torch.inf)
    # Sorted by cost, and not by weight, which is 0 for all that is unlikely.
    cost, order = cost.sort(dim=1, stable=True)
    return fused_m.clamp(min=0).gather(1, order[:, :kept]), cost[:, :kept].mul(-0.5).exp()


@loop
def rank_candidates(
    phase_rad: Array,
    amplitude: Array,
    noise: Array,
    model: MismatchModel,
    count: int,
    depth_m: Array,
    cost: Array,
) -> None:
    """The best of `count` wrap candidates of each pixel, by the mismatch of its frequencies.

    Parameters
    ----------
    phase_rad, amplitude : float32 [K, B, H, W]
    noise : float32 [B, H, W]
    depth_m, cost : float32 [B, I, H, W]
        Fused distance, and -2 times the logarithm of the weight, infinite beyond the range; are
        written, the least cost first, of equals the nearest.
    """
    frames, kept, rows, columns = depth_m.shape
    frequencies = len(phase_rad)
    scale_m2 = np.empty((frequencies, columns), np.float32)
    unsure, fused_m2, mismatch_m = np.empty((3, columns), np.float32)
    fused_m = np.empty((count, columns), np.float32)
    costs = np.empty((count, columns), np.float32)
    ranks = np.empty((count, columns), np.float32)
    # Loops over a row without branches take many pixels at once. They are short because the
    # compiler gives up on loops of more than a few arrays, which might overlap.
    for b in range(frames):
        for i in range(rows):
            first, deviation = phase_rad[0, b, i], noise[b, i]
            unsure[:], fused_m2[:] = ZERO, ZERO
            for k in range(frequencies):
                signal, scale = amplitude[k, b, i], scale_m2[k]
                squared, share = model.m_per_rad[k] * model.m_per_rad[k], model.shares[k]
                own_share, kept_share = share * share, (ONE - share) * (ONE - share)
                for j in range(columns):
                    ratio = deviation[j] / max(signal[j], LEAST_AMPLITUDE)
                    variance = ratio * ratio * HALF
                    own_m2 = squared * variance
                    unsure[j] += variance
                    scale[j] = model.mismatch_scale * (fused_m2[j] + own_m2 + model.systematic_m2)
                    fused_m2[j] = kept_share * fused_m2[j] + own_share * own_m2
            unsure /= model.phase_scale_rad2
            for n in range(count):
                wraps_m, fused, penalty = np.float32(n) * model.ranges_m[0], fused_m[n], costs[n]
                for j in range(columns):
                    fused[j] = first[j] * model.m_per_rad[0] + wraps_m
                penalty[:] = ZERO
                for k in range(1, frequencies):
                    phase, scale, share = phase_rad[k, b, i], scale_m2[k], model.shares[k]
                    m_per_rad, range_m = model.m_per_rad[k], model.ranges_m[k]
                    for j in range(columns):
                        gap = (fused[j] - phase[j] * m_per_rad) / range_m
                        mismatch_m[j] = (gap - np.rint(gap)) * range_m
                    for j in range(columns):
                        penalty[j] += mismatch_m[j] * mismatch_m[j] / scale[j]
                        fused[j] -= share * mismatch_m[j]
                for j in range(columns):
                    first_m = first[j] * model.m_per_rad[0] + wraps_m
                    whole = penalty[j] + unsure[j]
                    near = (first_m <= model.farthest_m) | (frequencies == 1)
                    penalty[j] = whole if near else INFINITE
                    fused[j] = max(fused[j], ZERO)
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
