"""Which reflectances surfaces have: a prior measured on frames of known distance."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor

from unwrap.signal import (
    Sensed,
    SensorDescription,
    Truth,
    first_phase,
    sample_noise_lsb,
    unambiguous_range_m,
)

LOWEST, HIGHEST, BINS = math.log(1e-4), math.log(10.0), 96
"""Natural logarithms of the reflectances told apart, and bins between them; assumed."""
BRIGHTEST = 0.98
"""Quantile of A d^2 that passes for a reflectance of 1; assumed. A few surfaces shine back more."""
MIN_SNR = 3.0
"""Amplitude over noise from which on a pixel counts; assumed."""
MIN_DISTANCE_M = 0.3
"""Nearer surfaces do not count (assumed): lens and laser are no longer one point."""


@dataclass(frozen=True)
class ReflectancePrior:
    """What amplitudes and wraps to expect.

    Attributes
    ----------
    amplitude_at_1m_lsb : float
        Amplitude of a Lambertian surface of reflectance 1, seen head-on at one metre.
    density : tuple of float
        Probability of the logarithm of the reflectance by bin, see `BINS`; sums to 1.
    wraps : tuple of float
        Probability of each wrap; sums to 1.
    """

    amplitude_at_1m_lsb: float
    density: tuple[float, ...]
    wraps: tuple[float, ...]

    def __post_init__(self) -> None:
        if not 0 < self.amplitude_at_1m_lsb < math.inf:
            raise ValueError(
                f"amplitude_at_1m_lsb is {self.amplitude_at_1m_lsb}; expected a positive number"
            )
        for name, least in (("density", BINS), ("wraps", 1)):
            values = getattr(self, name)
            if len(values) < least or not all(0 < value <= 1 for value in values):
                raise ValueError(f"{name} is {values}; expected {least} or more probabilities > 0")

    def log_density(self, at_1m_lsb: Tensor) -> Tensor:
        """ln p of the reflectances that amplitudes times squared distances (LSB m^2) imply."""
        # Amplitude 0 has no logarithm; what is clamped falls into the lowest bin.
        reflectance = (at_1m_lsb / self.amplitude_at_1m_lsb).clamp(min=1e-30)
        table = torch.tensor(self.density, device=at_1m_lsb.device).log()
        return table[_bins(reflectance.log())]

    def log_wraps(self, count: int) -> Tensor:
        """ln p of wraps 0..count - 1, float32 [count, 1, 1]; wraps never seen as the rarest."""
        rarest = min(self.wraps)
        shares = [*self.wraps[:count], *[rarest] * (count - len(self.wraps))]
        return torch.tensor(shares).log().view(-1, 1, 1)


def _bins(logarithm: Tensor) -> Tensor:
    place = (logarithm - LOWEST) * (BINS / (HIGHEST - LOWEST))
    return place.long().clamp(0, BINS - 1)


def calibrate(
    frames: Iterable[tuple[Sensed, Truth]], sensor: SensorDescription
) -> ReflectancePrior:
    """Measure the prior on frames of known distance, of two or more samples.

    Reflectances are those of pixels of known distance within the sensor's range that are not
    saturated and have a signal of at least `MIN_SNR` times the noise; wraps those of all pixels of
    known distance within the range. The scale is a quantile and the densities are counts, so that
    a few mirrors or wrong distances change little.

    Raises
    ------
    ValueError
        No pixel counts.
    """
    strengths, wraps = [], []
    for sensed, truth in frames:
        inside = truth.known & (truth.distance_m < sensor.max_range_m)
        inside &= truth.distance_m >= MIN_DISTANCE_M
        amplitude = first_phase(sensed, sensor).amplitude
        strong = amplitude >= MIN_SNR * sample_noise_lsb(sensed, sensor)
        scored = inside & strong & ~sensed.require_raw().saturated
        strengths.append((amplitude * truth.distance_m.square())[scored])
        wraps.append((truth.distance_m[inside] / unambiguous_range_m(sensor.f1_hz)).long())
    if not strengths or not sum(map(len, strengths)):
        raise ValueError("frames hold no pixel of known distance and enough signal")
    # From here on in logarithms, in which a factor on all amplitudes is a shift of the histogram.
    logarithm = torch.cat(strengths).log()
    # torch.quantile takes no more than 16 million values.
    scale = logarithm.kthvalue(max(1, round(BRIGHTEST * len(logarithm)))).values
    density = torch.bincount(_bins(logarithm - scale), minlength=BINS)
    return ReflectancePrior(
        float(scale.exp()), _shares(density), _shares(torch.bincount(torch.cat(wraps)))
    )


def _shares(counts: Tensor) -> tuple[float, ...]:
    """Counts to probabilities; a thousandth of the mean is added to each, so that none is 0."""
    # The prior's logarithm is taken, and what training frames lack may still be seen in others.
    values = counts.double() + counts.double().mean() * 1e-3
    return tuple((values / values.sum()).tolist())
