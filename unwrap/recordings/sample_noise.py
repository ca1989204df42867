"""How noisy the samples of a recording are, as they tell it themselves where they can."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional

from unwrap.recordings.camera import Camera
from unwrap.signal import RawFrame, Shots, samples_at

NoiseSource = Literal["told", "opposite samples", "dark noise"]
REACH_PX = 5
"""Neighbours to each side that a pixel's noise is measured over; assumed. 11 x 11 residuals give a
standard deviation within about a fifteenth."""
NORMAL_MEDIAN = 0.6745
"""Median of |x| of a standard normal x."""
OUTLIER, KEPT_VARIANCE = 3.0, 0.9733
"""Standard deviations from which on a residual is an outlier; variance of a normal x within."""
LEAST_NOISE_LSB = 1 / math.sqrt(12)
"""Rounding to words, which no sample is without."""


@dataclass(frozen=True)
class SampleNoise:
    """Standard deviation of one sample, and where it is known from.

    Attributes
    ----------
    noise_lsb : float32 [1, H, W]
    source : str
        "told" by who corrects; measured by the recording's own "opposite samples"; or the "dark
        noise" of the kind of camera, which knows nothing of the ambient light.
    """

    noise_lsb: Tensor
    source: NoiseSource


def noise_of(raw: RawFrame, camera: Camera, *, made: bool = False) -> SampleNoise:
    """Noise of the samples of one frame, a batch of one; `made` ones do not tell it."""
    blank = torch.zeros(raw.saturated.shape)
    if camera.noise_lsb is not None:
        return SampleNoise(blank + camera.noise_lsb, "told")
    if raw.shots == Shots.TWO or made:
        return SampleNoise(blank + camera.description.noise_lsb, "dark noise")
    measured_lsb = opposite_samples_noise_lsb(raw)
    # NaN where all neighbours are saturated: of such a pixel nothing is valid anyway.
    return SampleNoise(measured_lsb.nan_to_num(camera.description.noise_lsb), "opposite samples")


def opposite_samples_noise_lsb(raw: RawFrame) -> Tensor:
    """Noise of one sample by what is left of opposite ones, float32 [B, H, W], LSB.

    Light and its overtones cancel in D0 + D2 and in D1 + D3, the pixel's offset in their
    difference: (D0 + D2 - D1 - D3) / 2 is as noisy as one sample and has mean 0. Its rms around
    the pixel, over both frequencies where there are eight samples, is the noise; left out are edges
    that moved, outliers by the median of the magnitudes there.

    Parameters
    ----------
    raw : RawFrame
        Four or eight samples. Saturated pixels are left out; NaN where there are no others around.
    """
    residuals = []
    for frequency in range(int(raw.shots) // 4):
        first, second, third, fourth = samples_at(frequency, raw).unbind(1)
        apart = (first + third - second - fourth).abs() / 2
        residuals.append(apart.masked_fill(raw.saturated, torch.nan))
    padded = functional.pad(torch.stack(residuals, 1), (REACH_PX,) * 4, value=torch.nan)
    # [B, values around the pixel, H W]
    around = functional.unfold(padded, 2 * REACH_PX + 1)
    median = around.nanmedian(1, keepdim=True).values
    limit = OUTLIER * (median / NORMAL_MEDIAN).clamp(min=LEAST_NOISE_LSB)
    # A median of whole words comes in steps of half an LSB, so that it only tells what to leave.
    kept = around.square().masked_fill(around > limit, torch.nan)
    rms = (kept.nanmean(1) / KEPT_VARIANCE).sqrt().view(raw.saturated.shape)
    return rms.clamp(min=LEAST_NOISE_LSB)
