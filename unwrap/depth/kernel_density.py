"""Two-frequency unwrapping by a spatial kernel density, after Jaremo Lawin et al. (2016).

F. Jaremo Lawin, P.-E. Forssen, H. Ovren, Efficient Multi-Frequency Phase Unwrapping using Kernel
Density Estimation, ECCV 2016; the method behind libfreenect2's unwrapping of the Kinect v2. A pixel
alone often cannot tell which wrap hypothesis is right; its neighbours vote, each with a kernel
around the distances that it thinks likely. Adapted: two frequencies instead of three, and the
mismatch of phases is counted in its own standard deviations as the sensor's noise predicts them,
instead of the fixed weights and the fitted noise curves of one camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional

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
    depth_m, weight = _hypotheses(first, second, sensor, noise, parameters)
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


def _hypotheses(
    first: PhaseFrame,
    second: PhaseFrame,
    sensor: SensorDescription,
    noise: Tensor | float,
    parameters: KernelDensity,
) -> tuple[Tensor, Tensor]:
    """The likeliest distances and their weights, both [B, hypotheses, H, W], likeliest first."""
    range2_m = unambiguous_range_m(sensor.f2_hz)
    # Each candidate of f1 with its nearest one of f2: what rounding leaves is their mismatch.
    first_m = candidates_m(first.phase_rad, sensor.f1_hz, sensor.max_range_m)
    gap = (first_m - distance_m(second.phase_rad, sensor.f2_hz).unsqueeze(1)) / range2_m
    mismatch_m = (gap - gap.round()) * range2_m
    # Four samples: the variance of the phase is (noise / A)^2 / 2. The clamp is for pixels without
    # signal, whose variance is to be large rather than infinite.
    variance1, variance2 = (
        (noise / frame.amplitude.clamp(min=1e-6)).square().unsqueeze(1) / 2
        for frame in (first, second)
    )
    scale1, scale2 = (unambiguous_range_m(hz) / TWO_PI for hz in (sensor.f1_hz, sensor.f2_hz))
    variance_m2 = scale1**2 * variance1 + scale2**2 * variance2 + parameters.systematic_m**2
    cost = mismatch_m.square() / (parameters.mismatch_scale * variance_m2)
    unsure = (variance1 + variance2) / parameters.phase_scale_rad2
    weight = torch.exp(-0.5 * (cost + unsure)).where(first_m <= sensor.max_range_m, 0.0)
    # Fused by inverse variance, which goes with f^2, as in `unwrap_dual`.
    share2 = sensor.f2_hz**2 / (sensor.f1_hz**2 + sensor.f2_hz**2)
    fused_m = (first_m - share2 * mismatch_m).clamp(min=0)
    weight, order = weight.topk(min(parameters.hypotheses, weight.shape[1]), dim=1)
    return fused_m.gather(1, order), weight


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
    reach = parameters.radius
    height, width = depth_m.shape[-2:]
    # Padding has weight 0: what lies outside the image does not vote.
    padded_m = functional.pad(depth_m, (reach,) * 4)
    padded_weight = functional.pad(weight, (reach,) * 4)
    steps = torch.arange(-reach, reach + 1)
    gauss = torch.exp(-0.5 * (steps / parameters.spread_px).square())
    line = (gauss / gauss.sum()).tolist()
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
