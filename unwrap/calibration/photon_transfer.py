"""Photon transfer: gain, read noise and contrast from how temporal variance grows with light.

Source: EMVA Standard 1288, release 4.0, section on sensitivity: photons are counted, so that the
variance of a word grows with its mean, and the slope is the gain. A sample is the difference of two
taps: its variance is that of all light, while its mean is only that of the demodulated part.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unwrap.calibration.moments import Moments

Array = np.ndarray
ROUNDING_LSB2 = 1.0 / 12.0
"""Variance of rounding to words, where other noise is half an LSB or more (EMVA 1288)."""
REWEIGHTED = 4
LEAST_FRAMES = 4
"""Of a recording whose variances are used."""


def variance_fit(columns: Array, variance: Array, freedom: Array) -> Array:
    """Coefficients of a linear model of measured variances, each with its degrees of freedom.

    A variance of n degrees of freedom is uncertain by sqrt(2 / n) of itself: weights are taken from
    the fitted variances, not from the measured ones, whose small values would count too much.

    Parameters
    ----------
    columns : [N, C]
    variance, freedom : [N]
    """
    # Scaled to a largest value of one: a column of electrons stands beside one of ones.
    scale = np.abs(columns).max(0)
    scaled, expected = columns / scale, np.full_like(variance, variance.mean())
    for _ in range(REWEIGHTED):
        weight = freedom / expected**2
        normal = (scaled * weight[:, None]).T
        found = np.linalg.lstsq(normal @ scaled, normal @ variance, rcond=None)[0]
        expected = np.maximum(scaled @ found, 0.1 * ROUNDING_LSB2)
    return found / scale


def gray_gain(recordings: Sequence[Moments]) -> float:
    """Words of the gray image per electron of its tap: Var = K mean + what reading adds.

    NaN without gray images of ambient light.
    """
    lit = [r for r in recordings if has_electrons(r) and r.frames >= LEAST_FRAMES]
    if not lit:
        return float("nan")
    mean = np.concatenate([r.gray_mean for r in lit])
    variance = np.concatenate([r.gray_variance for r in lit])
    freedom = np.concatenate([np.full(r.flagged.shape, r.frames - 1.0) for r in lit])
    return float(variance_fit(np.stack((mean, np.ones_like(mean)), -1), variance, freedom)[0])


def has_electrons(recording: Moments) -> bool:
    """Whether the gray image can tell the electrons of the ambient light."""
    setting = recording.setting
    timed = setting.integration_s is not None and setting.gray_exposure_s is not None
    return setting.ambient and timed and recording.gray_mean is not None


def ambient_e(recording: Moments, gray_lsb_per_e: float) -> Array:
    """Electrons of ambient light in both taps of a sample [P]; 0 in a dark room, else NaN.

    Those of the gray image, scaled from its exposure to the integration time.
    """
    setting, gray = recording.setting, recording.gray_mean
    if not setting.ambient:
        return np.zeros(recording.flagged.shape)
    if gray is None or setting.integration_s is None or setting.gray_exposure_s is None:
        return np.full(recording.flagged.shape, np.nan)
    return gray * (setting.integration_s / setting.gray_exposure_s / gray_lsb_per_e)


def transfer_points(
    recordings: Sequence[Moments], amplitudes: Sequence[Array], gray_lsb_per_e: float
) -> tuple[Array, Array, Array]:
    """Light and variance of every pixel and frequency that is never saturated.

    Parameters
    ----------
    amplitudes : [K, P] of each recording
        Of the fundamental, LSB; 0 where the laser is off.

    Returns
    -------
    columns : [N, 3]
        Amplitude in LSB, ambient electrons, 1.
    variance, freedom : [N]
    """
    columns, variances, freedoms = [np.zeros((0, 3))], [np.zeros(0)], [np.zeros(0)]
    for recording, amplitude in zip(recordings, amplitudes, strict=True):
        if recording.frames < LEAST_FRAMES:
            continue
        ambient = np.broadcast_to(ambient_e(recording, gray_lsb_per_e), amplitude.shape)
        used = np.broadcast_to(recording.flagged == 0, amplitude.shape) & np.isfinite(ambient)
        one = np.ones(np.count_nonzero(used))
        columns.append(np.stack((amplitude[used], ambient[used], one), -1))
        variances.append(recording.variance_lsb2[used])
        # Four samples at one frequency are averaged.
        freedoms.append(one * (4 * (recording.frames - 1)))
    return np.concatenate(columns), np.concatenate(variances), np.concatenate(freedoms)


def photon_transfer(columns: Array, variance: Array, freedom: Array) -> tuple[float, float, float]:
    """Var(D) = (g / m) A + g^2 B + V_dark of the points of `transfer_points`.

    Derived from Var = g^2 (S + B + 2 sigma_r^2) + 1 / 12 with the amplitude A = g m S.

    Returns
    -------
    gain_over_contrast, gain, dark_lsb2 : float
        g / m and g in LSB per electron, V_dark in LSB^2; NaN where no light tells it.
    """
    lit = columns.max(0, initial=0.0) > 0
    found = np.full(3, np.nan)
    if not lit.any():
        return np.nan, np.nan, np.nan
    found[lit] = variance_fit(columns[:, lit], variance, freedom)
    over_contrast, gain_squared, dark = found
    return float(over_contrast), float(np.sqrt(max(gain_squared, 0.0))) if lit[1] else np.nan, dark


def read_noise_e(dark_lsb2: float, gain_lsb_per_e: float) -> float:
    """Read noise of one tap of two, electrons rms: V_dark = 2 (g sigma_r)^2 + 1 / 12."""
    return float(np.sqrt(max(dark_lsb2 - ROUNDING_LSB2, 0.0) / 2) / gain_lsb_per_e)
