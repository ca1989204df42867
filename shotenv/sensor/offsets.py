"""Fixed-pattern offset of the taps: seen by two samples, cancelled by four."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.config import SensorConfig


@dataclass(frozen=True)
class OffsetPattern:
    """Offset of every pixel of each sensor in the batch.

    Attributes
    ----------
    pattern_lsb : float32 [B, H, W]
        Added to every sample of the pixel.
    calibrated_lsb : float32 [B, H, W]
        The stored dark-offset map, which a decoder of two samples subtracts.
    """

    pattern_lsb: Tensor
    calibrated_lsb: Tensor

    def __getitem__(self, index) -> OffsetPattern:
        """Sensors chosen by a batch index."""
        return OffsetPattern(self.pattern_lsb[index], self.calibrated_lsb[index])


def draw_offsets(
    sensor: SensorConfig,
    height: int,
    width: int,
    *,
    generator: torch.Generator,
    imager_k: float | None = None,
) -> OffsetPattern:
    """Offset pattern of one sensor, batch of one: a part common to each row and a part per pixel.

    `offset_row_share` of the variance is the row's. The stored map knows
    `offset_calibrated_share` of the pattern as it was at the calibration temperature. An imager
    at `imager_k` kelvin (None: at that temperature) adds a pattern that no map knows, of its own
    for each pixel and proportional to the difference of temperature.
    """
    row = torch.randn(height, 1, generator=generator)
    pixel = torch.randn(height, width, generator=generator)
    share = sensor.offset_row_share
    # Variances add up to one.
    unit = math.sqrt(share) * row + math.sqrt(1.0 - share) * pixel
    pattern = (sensor.offset_std_lsb * unit).unsqueeze(0)
    warmer_k = 0.0 if imager_k is None else imager_k - sensor.calibration_temperature_k
    # Drawn whatever the temperature, so that the generator is left in the same state.
    drift = torch.randn(height, width, generator=generator)
    drift.mul_(sensor.offset_drift_lsb_per_k * warmer_k)
    # The map holds a share of every pixel's value, so that what it misses has the same pattern.
    return OffsetPattern(pattern + drift, sensor.offset_calibrated_share * pattern)


def offset_left_lsb(sensor: SensorConfig, imager_k: Tensor) -> Tensor:
    """Standard deviation of what the stored map leaves, of the shape of `imager_k`, LSB.

    As the sensor can expect it from its calibration and its thermometer; what ambient light adds
    is not in it.
    """
    unknown_lsb = (1.0 - sensor.offset_calibrated_share) * sensor.offset_std_lsb
    warmer_k = imager_k - sensor.calibration_temperature_k
    return torch.hypot(
        torch.full_like(imager_k, unknown_lsb), sensor.offset_drift_lsb_per_k * warmer_k
    )
