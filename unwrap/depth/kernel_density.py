"""Two-frequency unwrapping by a spatial kernel density, after Jaremo Lawin et al. (2016).

F. Jaremo Lawin, P.-E. Forssen, H. Ovren, Efficient Multi-Frequency Phase Unwrapping using Kernel
Density Estimation, ECCV 2016; the method behind libfreenect2's unwrapping of the Kinect v2. A pixel
alone often cannot tell which wrap hypothesis is right; its neighbours vote, each with a kernel
around the distances that it thinks likely. Adapted: two frequencies instead of three, and the
mismatch of phases is counted in its own standard deviations as the sensor's noise predicts them,
instead of the fixed weights and the fitted noise curves of one camera.

Everything stands twice, and tests hold both together: chains of torch operations, for any device
and for gradients, which are the reference, and compiled loops, which processors use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from unwrap.depth.bilateral_grid import BIN_PER_KERNEL, REACH, vote_pixels
from unwrap.depth.candidates import (
    DepthWithConfidence,
    candidates_m,
    chosen,
    depth_with_confidence,
    require_shots,
)
from unwrap.signal import (
    TWO_PI,
    PhaseFrame,
    RawFrame,
    SensorDescription,
    Shots,
    decode_at,
    distance_m,
    unambiguous_range_m,
)
from unwrap.support import array, array_of, can_loop, loop

Array = np.ndarray
# float32, since a Python float would make the arithmetic of a loop float64.
ZERO, HALF, INFINITE = map(np.float32, (0.0, 0.5, np.inf))
LEAST_AMPLITUDE = np.float32(1e-6)
"""Pixels without signal count as this strong: their variance is to be large, not infinite."""


@dataclass(frozen=True)
class KernelDensity:
    """Parameters of the vote.

    Defaults are those of libfreenect2 for the Kinect v2 where nothing else is said; "assumed" ones
    were not measured.

    Attributes
    ----------
    hypotheses : int
        Likeliest wrap hypotheses kept per pixel; the paper tries two and three, libfreenect2 keeps
        two.
    radius : int
        Neighbours reach so many pixels; 5 is the paper's window of 11 x 11.
    spread_px : float
        Standard deviation of the spatial weight; assumed, half the radius.
    kernel_m : float
        Standard deviation of the kernel over distances; assumed. About 0.3 m for the Kinect, whose
        frequencies are higher and whose distances therefore scatter less.
    mismatch_scale : float
        Variance of the normalised phase mismatch at which a hypothesis counts exp(-1/2).
    phase_scale_rad2 : float
        Sum of phase variances at which a pixel counts exp(-1/2).
    systematic_m : float
        Standard deviation of the mismatch that noise does not explain, wiggle, motion, multipath;
        assumed.
    least_weight : float
        Weight of a neighbourhood below which its confidence falls; assumed.
    min_confidence : float
        Confidence from which on a pixel is valid; assumed. libfreenect2 takes 0.5.
    """

    hypotheses: int = 3
    radius: int = 5
    spread_px: float = 2.5
    kernel_m: float = 0.5
    mismatch_scale: float = 2.0
    phase_scale_rad2: float = 3.0
    systematic_m: float = 0.1
    least_weight: float = 0.5
    min_confidence: float = 0.2

    def __post_init__(self) -> None:
        for name, least in (
            ("hypotheses", 1),
            ("radius", 0),
            ("spread_px", 0.1),
            ("kernel_m", 0.01),
        ):
            if not getattr(self, name) >= least:  # False for NaN, too.
                raise ValueError(f"{name} is {getattr(self, name)}; expected at least {least}")

    @property
    def line(self) -> Tensor:
        """Weights of the neighbours along a row or a column, float32 [2 radius + 1]; sum 1."""
        steps = torch.arange(-self.radius, self.radius + 1)
        gauss = torch.exp(-0.5 * (steps / self.spread_px).square())
        return gauss / gauss.sum()

    @property
    def pair_weights(self) -> Array:
        """Of `line`, as `vote_pixels` takes it: half of the middle, the right side, zeros."""
        right = self.line[self.radius :].numpy()
        padded = np.zeros(-(-len(right) // 3) * 3, np.float32)
        padded[: len(right)] = right
        padded[0] /= 2
        return padded


def unwrap_kernel_density(
    raw: RawFrame,
    sensor: SensorDescription,
    *,
    offset_lsb: Tensor | None = None,
    noise_lsb: Tensor | float | None = None,
    shift_m: Tensor | None = None,
    parameters: KernelDensity | None = None,
) -> DepthWithConfidence:
    """Depth of eight samples; the confidence is the winner's share of its neighbours' weight.

    Parameters
    ----------
    raw : RawFrame
        Eight samples.
    offset_lsb, noise_lsb, shift_m
        See `unwrap.depth.correction.correct`.

    Raises
    ------
    ValueError
        Another number of samples.
    """
    require_shots(raw, (Shots.EIGHT,))
    parameters = parameters or KernelDensity()
    noise = sensor.noise_lsb if noise_lsb is None else noise_lsb
    first, second = (
        decode_at(i, raw, sensor, offset_lsb=offset_lsb, shift_m=shift_m) for i in (0, 1)
    )
    depth_m, weight = hypotheses(first, second, sensor, noise, parameters)
    confidence, winner = kernel_density(depth_m, weight, parameters).max(1)
    return depth_with_confidence(
        chosen(depth_m, winner),
        confidence,
        first,
        raw,
        sensor,
        noise_lsb=noise,
        min_confidence=parameters.min_confidence,
    )


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
        See `KernelDensity`.
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
    def of(cls, sensor: SensorDescription, parameters: KernelDensity) -> MismatchModel:
        """For a sensor's frequencies."""
        range1_m, range2_m = (unambiguous_range_m(hz) for hz in (sensor.f1_hz, sensor.f2_hz))
        return cls(
            range1_m,
            range2_m,
            sensor.max_range_m,
            range1_m / TWO_PI,
            range2_m / TWO_PI,
            parameters.systematic_m**2,
            parameters.mismatch_scale,
            parameters.phase_scale_rad2,
            sensor.f2_hz**2 / (sensor.f1_hz**2 + sensor.f2_hz**2),
        )


def hypotheses(
    first: PhaseFrame,
    second: PhaseFrame,
    sensor: SensorDescription,
    noise: Tensor | float,
    parameters: KernelDensity,
) -> tuple[Tensor, Tensor]:
    """The likeliest distances and their weights, both [B, hypotheses, H, W], likeliest first."""
    model = MismatchModel.of(sensor, parameters)
    count = math.floor(sensor.max_range_m / model.range1_m) + 1
    kept = min(parameters.hypotheses, count)
    maps = (first.phase_rad, second.phase_rad, first.amplitude, second.amplitude)
    if not can_loop(*maps):
        return hypotheses_by_torch(first, second, sensor, noise, model, kept)
    batch, height, width = first.phase_rad.shape
    depth_m, cost = torch.empty(2, batch, kept, height, width).unbind()
    rank_candidates(
        *map(array, maps),
        array_of(noise, first.phase_rad.shape),
        MismatchModel(*map(np.float32, model)),
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
    fused_m = np.empty((count, columns), np.float32)
    costs = np.empty((count, columns), np.float32)
    ranks = np.empty((count, columns), np.int32)
    squared1, squared2 = model.m_per_rad1 * model.m_per_rad1, model.m_per_rad2 * model.m_per_rad2
    # Every step is a loop over a row without branches, which take many pixels at once.
    for b in range(frames):
        for i in range(rows):
            phase1, phase2, deviation = phase1_rad[b, i], phase2_rad[b, i], noise[b, i]
            signal1, signal2 = amplitude1[b, i], amplitude2[b, i]
            for n in range(count):
                wraps_m, fused, penalty = np.float32(n) * model.range1_m, fused_m[n], costs[n]
                for j in range(columns):
                    first_m = phase1[j] * model.m_per_rad1 + wraps_m
                    gap = (first_m - phase2[j] * model.m_per_rad2) / model.range2_m
                    mismatch_m = (gap - np.rint(gap)) * model.range2_m
                    ratio1 = deviation[j] / max(signal1[j], LEAST_AMPLITUDE)
                    ratio2 = deviation[j] / max(signal2[j], LEAST_AMPLITUDE)
                    variance1, variance2 = ratio1 * ratio1 * HALF, ratio2 * ratio2 * HALF
                    variance_m2 = squared1 * variance1 + squared2 * variance2
                    scale_m2 = model.mismatch_scale * (variance_m2 + model.systematic_m2)
                    unsure = (variance1 + variance2) / model.phase_scale_rad2
                    whole = mismatch_m * mismatch_m / scale_m2 + unsure
                    penalty[j] = whole if first_m <= model.farthest_m else INFINITE
                    fused[j] = max(first_m - model.share2 * mismatch_m, ZERO)
            # The rank of a candidate is the number of those that go before it.
            ranks[:] = 0
            for n in range(count):
                for m in range(n):
                    earlier, later, before, after = costs[m], costs[n], ranks[m], ranks[n]
                    for j in range(columns):
                        swapped = later[j] < earlier[j]
                        before[j] += np.int32(swapped)
                        after[j] += np.int32(not swapped)
            for h in range(kept):
                best_m, least = depth_m[b, h, i], cost[b, h, i]
                best_m[:], least[:] = ZERO, INFINITE
                for n in range(count):
                    fused, penalty, rank = fused_m[n], costs[n], ranks[n]
                    for j in range(columns):
                        best_m[j] = fused[j] if rank[j] == h else best_m[j]
                        least[j] = penalty[j] if rank[j] == h else least[j]


def kernel_density(depth_m: Tensor, weight: Tensor, parameters: KernelDensity) -> Tensor:
    """Density of the neighbours' weighted hypotheses at each of a pixel's own.

    sum of g w K(t - t') over the neighbours' hypotheses t' with weights w, over the sum of g w;
    g Gaussian over pixels, K over distances. Neighbours outside the image do not count.

    Parameters
    ----------
    depth_m, weight : float [B, I, H, W]
        Hypotheses of each pixel.

    Returns
    -------
    float [B, I, H, W]
        0..1.
    """
    if not can_loop(depth_m, weight):
        return density_by_torch(depth_m, weight, parameters)
    bin_m = BIN_PER_KERNEL * parameters.kernel_m
    nearest_m, farthest_m = depth_m.aminmax()
    if not math.isfinite(farthest_m - nearest_m):  # NaN has no bin.
        return density_by_torch(depth_m, weight, parameters)
    # One bin more below, which holds the whole weight, and one on both sides for rounding.
    first_bin = math.floor(nearest_m / bin_m) - REACH - 2
    bins = math.ceil(farthest_m / bin_m) + REACH + 2 - first_bin
    density = torch.empty(depth_m.shape)
    vote_pixels(
        array(depth_m),
        array(weight),
        parameters.pair_weights,
        np.float32(1 / bin_m),
        first_bin,
        bins,
        np.float32(parameters.least_weight),
        array(density),
    )
    return density


def density_by_torch(depth_m: Tensor, weight: Tensor, parameters: KernelDensity) -> Tensor:
    """Reference of `vote_pixels`."""
    reach = parameters.radius
    height, width = depth_m.shape[-2:]
    # Padding has weight 0: what lies outside the image does not vote.
    padded_m = functional.pad(depth_m, (reach,) * 4)
    padded_weight = functional.pad(weight, (reach,) * 4)
    line = parameters.line.tolist()
    # The kernel over distances keeps the sum from being a convolution; it is a sum over shifts.
    votes, total = torch.zeros_like(depth_m), torch.zeros_like(depth_m[:, :1])
    # One shifted image after the other: all at once would take as many times the memory.
    for y, of_row in enumerate(line):
        for x, of_column in enumerate(line):
            window = (..., slice(y, y + height), slice(x, x + width))
            near = padded_weight[window] * (of_row * of_column)
            distance = padded_m[window].unsqueeze(1) - depth_m.unsqueeze(2)
            kernel = distance.square_().mul_(-0.5 / parameters.kernel_m**2).exp_()
            votes += kernel.mul_(near.unsqueeze(1)).sum(2)
            total += near.sum(1, keepdim=True)
    return votes / total.clamp(min=parameters.least_weight)
