"""What the frames of one recording say of each pixel: means, temporal variances, flags."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

Array = np.ndarray
Kind = Literal["dark", "still", "wall", "warm"]


@dataclass(frozen=True)
class Setting:
    """What is known of a recording besides its frames.

    Attributes
    ----------
    kind : str
        "dark": laser off; "still": a scene that does not move; "wall": a flat wall at `distance_m`;
        "warm": a still scene, the same in all of them, at `temperature_k`.
    name : str
        For messages and charts.
    distance_m : float or None
        Of a wall that faces the camera, along the optical axis, metres.
    temperature_k : float or None
        Of the imager, kelvin.
    integration_s, gray_exposure_s : float or None
        Of one sample and of the gray image, seconds.
    ambient : bool
        Whether there was other light than the laser's. Its electrons are told by the gray images.
    """

    kind: Kind
    name: str = ""
    distance_m: float | None = None
    temperature_k: float | None = None
    integration_s: float | None = None
    gray_exposure_s: float | None = None
    ambient: bool = False


@dataclass(frozen=True)
class Moments:
    """Moments over the frames of a recording, for P pixels, float64.

    Attributes
    ----------
    setting : Setting
    frames : int
    mean_lsb : [K, 4, P]
        Mean of each sample at K modulation frequencies.
    variance_lsb2 : [K, P]
        Temporal variance of a sample, unbiased, mean over the four; NaN of a single frame.
    flagged : [P]
        Share of frames in which the pixel was saturated.
    gray_mean, gray_variance : [P] or None
        Of the words of the gray image.
    """

    setting: Setting
    frames: int
    mean_lsb: Array
    variance_lsb2: Array
    flagged: Array
    gray_mean: Array | None = None
    gray_variance: Array | None = None

    @property
    def phasors(self) -> Array:
        """(D0 - D2 + i (D1 - D3)) / 2, complex [K, P]: amplitude and phase; offsets cancel."""
        first, second, third, fourth = np.moveaxis(self.mean_lsb, 1, 0)
        return (first - third + 1j * (second - fourth)) / 2

    @property
    def offset_lsb(self) -> Array:
        """Mean of all samples [P], in which light and its odd overtones cancel."""
        return self.mean_lsb.mean((0, 1))

    def of(self, pixels: Array) -> Moments:
        """Some of the pixels, by index or mask."""
        gray, variance = self.gray_mean, self.gray_variance
        return replace(
            self,
            mean_lsb=self.mean_lsb[..., pixels],
            variance_lsb2=self.variance_lsb2[..., pixels],
            flagged=self.flagged[pixels],
            gray_mean=None if gray is None else gray[pixels],
            gray_variance=None if variance is None else variance[pixels],
        )


def moments_of(
    setting: Setting, samples_lsb: Array, saturated: Array, gray_words: Array | None = None
) -> Moments:
    """Moments of the frames of one recording.

    Parameters
    ----------
    setting : Setting
    samples_lsb : [F, K, 4, H, W]
        Samples D_k ~ cos(phi - k pi / 2) of K modulation frequencies, LSB.
    saturated : bool [F, H, W]
    gray_words : [F, H, W], optional

    Raises
    ------
    ValueError
        Shapes that do not fit each other; the message names the recording.
    """
    frames, frequencies, count = samples_lsb.shape[:3]
    expected = (frames, *samples_lsb.shape[3:])
    for name, maps in (("saturated", saturated), ("gray", gray_words)):
        if maps is not None and maps.shape != expected:
            raise ValueError(f"{setting.name}: {name} is {maps.shape}; expected {expected}")
    if count != 4:
        raise ValueError(f"{setting.name}: {count} samples a frequency; expected 4")
    samples = samples_lsb.reshape(frames, frequencies, 4, -1)
    mean, variance = _mean_and_variance(samples)
    flagged = saturated.reshape(frames, -1).mean(0)
    found = Moments(setting, frames, mean, variance.mean(1), flagged)
    if gray_words is None:
        return found
    gray_mean, gray_variance = _mean_and_variance(gray_words.reshape(frames, -1))
    return replace(found, gray_mean=gray_mean, gray_variance=gray_variance)


def _mean_and_variance(values: Array) -> tuple[Array, Array]:
    """Over the first axis; the variance of a single frame is NaN."""
    mean = values.mean(0, dtype=np.float64)
    if len(values) == 1:
        return mean, np.full_like(mean, np.nan)
    # Of differences from the mean, and not of squares: those of float32 words would cancel.
    return mean, np.square(values - mean).sum(0) / (len(values) - 1)
