"""Unwrapping by the density of neighbours' hypotheses, after Jaremo Lawin et al. (2016).

F. Jaremo Lawin, P.-E. Forssen, H. Ovren, Efficient Multi-Frequency Phase Unwrapping using Kernel
Density Estimation, ECCV 2016; the method behind libfreenect2's unwrapping of the Kinect v2. A pixel
alone often cannot tell which wrap hypothesis is right; its neighbours vote, each with a kernel
around the distances that it thinks likely. Adapted: one to three frequencies, and the mismatch of
phases is counted in its own standard deviations as the sensor's noise predicts them, instead of the
fixed weights and the fitted noise curves of one camera.

Everything stands twice, and tests hold both together: chains of torch operations, for any device
and for gradients, which are the reference, and compiled loops, which processors use.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from unwrap.depth.bilateral_grid import BIN_PER_KERNEL, REACH, vote_pixels
from unwrap.depth.candidates import (
    DepthWithConfidence,
    chosen,
    depth_with_confidence,
    require_shots,
)
from unwrap.depth.mismatch import MismatchModel, hypotheses
from unwrap.depth.multi_frequency import check_phases
from unwrap.signal import PhaseFrame, RawFrame, SensorDescription, Shots, decode_at
from unwrap.support import array, can_loop

Array = np.ndarray


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

    def mismatch_model(self, frequencies_hz: Sequence[float], max_range_m: float) -> MismatchModel:
        """By which the hypotheses of a pixel are weighed."""
        return MismatchModel.of(
            frequencies_hz,
            max_range_m,
            systematic_m=self.systematic_m,
            mismatch_scale=self.mismatch_scale,
            phase_scale_rad2=self.phase_scale_rad2,
        )

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
    frames = [decode_at(i, raw, sensor, offset_lsb=offset_lsb, shift_m=shift_m) for i in (0, 1)]
    depth_m, confidence = vote_frequencies(
        frames,
        (sensor.f1_hz, sensor.f2_hz),
        noise,
        max_range_m=sensor.max_range_m,
        parameters=parameters,
    )
    return depth_with_confidence(
        depth_m,
        confidence,
        frames[0],
        raw,
        sensor,
        noise_lsb=noise,
        min_confidence=parameters.min_confidence,
    )


def vote_frequencies(
    frames: Sequence[PhaseFrame],
    frequencies_hz: Sequence[float],
    noise_lsb: Tensor | float,
    *,
    max_range_m: float,
    parameters: KernelDensity | None = None,
) -> tuple[Tensor, Tensor]:
    """Distance by the neighbours' vote over the phases of one, two or three frequencies.

    One frequency has one hypothesis, its wrapped distance; the vote then tells how many neighbours
    share it.

    Parameters
    ----------
    frames : K of PhaseFrame [B, H, W]
        Of four samples each.
    frequencies_hz : K floats
        The highest first, as in `unwrap_frequencies`.
    noise_lsb : float or float [B, H, W]
        Standard deviation of one sample.
    max_range_m : float
        Largest distance considered, metres.

    Returns
    -------
    distance_m, confidence : float [B, H, W]
        Fused distance of the winner, metres, and its share of the neighbours' weight, 0..1.

    Raises
    ------
    ValueError
        Another number of frequencies, unequal shapes, or a frequency or range that is not positive.
    """
    check_phases([one.phase_rad for one in frames], frequencies_hz, max_range_m)
    parameters = parameters or KernelDensity()
    model = parameters.mismatch_model(frequencies_hz, max_range_m)
    depth_m, weight = hypotheses(frames, noise_lsb, model, parameters.hypotheses)
    confidence, winner = kernel_density(depth_m, weight, parameters).max(1)
    return chosen(depth_m, winner), confidence


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
    last_bin = math.ceil(farthest_m / bin_m) + REACH + 1
    # In eights, so that neighbouring pixels' bins lie alike in vectors.
    bins = 8 * math.ceil((last_bin + 1 - first_bin) / 8)
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
