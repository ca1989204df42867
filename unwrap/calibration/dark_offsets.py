"""Fixed pattern: dark-offset map, its rows and pixels, what ambient light and temperature add."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unwrap.calibration.intervals import Estimate, pivotal, variance_draws
from unwrap.calibration.moments import Moments

Array = np.ndarray


def offset_map(dark: Sequence[Moments]) -> tuple[Array, float]:
    """Offset of every pixel [P], LSB, and the variance of its noise, from frames in the dark."""
    frames = np.array([r.frames for r in dark], float)
    pattern = np.average([r.offset_lsb for r in dark], axis=0, weights=frames)
    samples = 4 * dark[0].mean_lsb.shape[0] * frames.sum()
    variance = np.average([r.variance_lsb2.mean() for r in dark], weights=frames)
    return pattern, float(variance / samples)


def pattern_parts(
    pattern_lsb: Array, noise_lsb2: float, generator: np.random.Generator
) -> tuple[Estimate, Estimate]:
    """Standard deviation of the pattern, and the share of its variance common to a row.

    One-way analysis of variance with random rows: the mean squares between and within rows of W
    pixels expect `W rows + pixels` and `pixels`, the variances of both parts. They are chi-squares,
    of which intervals are drawn (Weerahandi, Generalized Confidence Intervals, 1993).

    Parameters
    ----------
    pattern_lsb : [H, W]
    noise_lsb2 : float
        Variance of the map's own noise.
    """
    height, width = pattern_lsb.shape
    rows = pattern_lsb.mean(1)
    between = width * rows.var(ddof=1)
    within = np.square(pattern_lsb - rows[:, None]).sum() / (height * (width - 1))

    def parts(between, within):
        row = np.maximum(between - within, 0.0) / width
        # What is left of the noise is not negative, and neither is the pattern.
        total = np.maximum(row + within - noise_lsb2, 1e-12)
        return np.sqrt(total), np.minimum(row / total, 1.0)

    std, share = parts(between, within)
    draws = parts(
        variance_draws(between, height - 1, generator),
        variance_draws(within, height * (width - 1), generator),
    )
    return pivotal(std, draws[0]), pivotal(share, draws[1])


def ambient_slope(
    pattern_lsb: Array, lit: Sequence[Moments], electrons: Sequence[Array], parity: Array
) -> float:
    """Offset that an electron of ambient light adds in even rows and takes in odd ones, LSB/e.

    Least squares through zero over pixels that are never saturated; NaN without light.

    Parameters
    ----------
    pattern_lsb, parity : [P]
        The dark map; 1 in even and -1 in odd rows.
    lit : recordings with ambient light
    electrons : [P] of each
        Ambient electrons in both taps.
    """
    product, square = 0.0, 0.0
    for recording, ambient in zip(lit, electrons, strict=True):
        light = np.where(recording.flagged == 0, parity * ambient, 0.0)
        product += float(light @ (recording.offset_lsb - pattern_lsb))
        square += float(light @ light)
    return product / square if square > 0 else float("nan")


def drift_of_pattern(dark: Sequence[Moments], generator: np.random.Generator) -> Estimate | None:
    """Standard deviation of the offsets' change per kelvin, LSB/K; None of fewer than two.

    The slope of each pixel over temperature by least squares; the variance of the slopes, of which
    every pixel is a draw, less that of their noise.
    """
    kelvin = np.array([r.setting.temperature_k for r in dark], float)
    spread = np.square(kelvin - kelvin.mean()).sum()
    if len(dark) < 2 or spread < 1.0:
        return None
    offsets = np.stack([r.offset_lsb for r in dark])
    slopes = (kelvin - kelvin.mean()) @ offsets / spread
    noise = [r.variance_lsb2.mean() / (4 * len(r.mean_lsb) * r.frames) for r in dark]
    expected = np.square(kelvin - kelvin.mean()) @ noise / spread**2
    measured = slopes.var(ddof=1)
    draws = variance_draws(measured, slopes.size - 1, generator)
    drift = np.sqrt(np.maximum(draws - expected, 0.0))
    return pivotal(float(np.sqrt(max(measured - expected, 0.0))), drift)
