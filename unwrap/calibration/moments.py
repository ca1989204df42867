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
    gathered = MomentsInPieces(setting.name)
    gathered.add(samples_lsb, saturated, gray_words)
    return gathered.of(setting)


class MomentsInPieces:
    """Moments of a recording whose frames are taken in piece by piece.

    Parameters
    ----------
    name : str
        Of the recording, for what is refused.
    cut_off : bool
        Saturated pixels hold no samples: means and variances are of a pixel's other frames.
    """

    def __init__(self, name: str, *, cut_off: bool = False) -> None:
        self.name, self.cut_off, self.frames = name, cut_off, 0
        self._samples, self._gray, self._flagged = Gathered(), Gathered(), np.zeros(1)

    def add(self, samples_lsb: Array, saturated: Array, gray_words: Array | None = None) -> None:
        """Take in frames; see `moments_of` for their shapes and for what is refused."""
        frames, _, count = samples_lsb.shape[:3]
        expected = (frames, *samples_lsb.shape[3:])
        for name, maps in (("saturated", saturated), ("gray", gray_words)):
            if maps is not None and maps.shape != expected:
                raise ValueError(f"{self.name}: {name} is {maps.shape}; expected {expected}")
        if count != 4:
            raise ValueError(f"{self.name}: {count} samples a frequency; expected 4")
        flags = saturated.reshape(frames, -1)
        samples = samples_lsb.reshape(*samples_lsb.shape[:3], -1)
        self._samples.add(samples, ~flags if self.cut_off else None)
        self.frames, self._flagged = self.frames + frames, self._flagged + flags.sum(0)
        if gray_words is not None:
            self._gray.add(gray_words.reshape(frames, -1))

    def of(self, setting: Setting) -> Moments:
        """Moments of all that was taken in."""
        samples, gray = self._samples, self._gray
        flagged = self._flagged / self.frames
        found = Moments(setting, self.frames, samples.mean, samples.variance.mean(1), flagged)
        if not np.any(gray.count):
            return found
        return replace(found, gray_mean=gray.mean, gray_variance=gray.variance)


class Gathered:
    """Mean and variance [..., P] over frames that come in pieces.

    Pairwise, from differences and not from squares: those of float32 words would cancel (Chan,
    Golub and LeVeque 1983, Algorithms for computing the sample variance).
    """

    def __init__(self) -> None:
        self.count: Array = np.zeros(1)
        self.mean: Array = np.zeros(1)
        self._squares: Array = np.zeros(1)

    def add(self, values: Array, used: Array | None = None) -> None:
        """Take in frames [F, ..., P], of each pixel those that are `used` [F, P]."""
        frames, pixels = len(values), values.shape[-1]
        if used is None:
            count, mean = np.full(pixels, float(frames)), values.mean(0, dtype=np.float64)
            squares = np.square(values - mean).sum(0)
        else:
            weight = used.reshape(frames, *(1,) * (values.ndim - 2), pixels)
            count = used.sum(0, dtype=np.float64)
            mean = (values * weight).sum(0, dtype=np.float64) / np.maximum(count, 1.0)
            squares = (np.square(values - mean) * weight).sum(0)
        total, step = self.count + count, mean - self.mean
        share = count / np.maximum(total, 1.0)
        self._squares = self._squares + squares + np.square(step) * self.count * share
        self.mean = self.mean + step * share
        self.count = total

    @property
    def variance(self) -> Array:
        """Unbiased; NaN of a single frame, 0 of a pixel that was used in fewer than two of many."""
        if np.max(self.count) <= 1:
            return np.full_like(self.mean, np.nan)
        return self._squares / np.maximum(self.count - 1, 1.0)
