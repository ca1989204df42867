"""The passive gray image: ambient light alone, exposure time by an ideal light meter."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from shotenv.config import SensorConfig
from shotenv.sensor.acquisition import pixel_of
from shotenv.sensor.converter import full_scale_lsb
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.pixel_loops import noise_by_gray_, take_gray_
from unwrap.support import array, long_rows

SHORTEST_EXPOSURE_S = 1e-5
"""What the light meter stops at in a scene however bright, s; assumed."""
ROUNDING_VARIANCE_LSB2 = 1.0 / 12.0
"""Of an error that is even over one LSB. In the dark it is 4 % of an epc660's variance."""


def capture_gray(
    ambient: Tensor, sensor: SensorConfig, *, noise: Tensor | None
) -> tuple[Tensor, Tensor]:
    """Gray image of the scene without laser.

    Parameters
    ----------
    ambient : float32 [B, H, W]
        Radiance inside the band filter, W m-2 sr-1, mean over the exposure where things move.
    sensor : SensorConfig
        The imager; a full tap is the converter's full scale.
    noise : float32 [B, H, W] or None
        Standard normals; None leaves shot and read noise out.

    Returns
    -------
    gray : int32 [B, H, W]
        Words of the converter, 0..2^bits - 1.
    exposure_s : float32 [B]
        Exposure time of each image, seconds.
    """
    exposure_s = gray_exposure_s(ambient, sensor)
    per_light_e = exposure_s * electrons_per_radiance_second(sensor)
    pixel = pixel_of(sensor)._replace(
        gain_lsb_per_e=np.float32(gray_gain_lsb_per_e(sensor)),
        low_lsb=np.float32(0),
        high_lsb=np.float32(full_scale_lsb(sensor.adc_bits)),
    )
    if noise is None:
        # Without the variance a packet is its charge alone, as it should be without noise.
        noise, pixel = torch.zeros(ambient.shape), pixel._replace(read_variance_e=np.float32(0))
    words = np.empty(ambient.shape, np.int32)
    take_gray_(array(ambient), array(per_light_e), array(noise.expand_as(ambient)), pixel, words)
    return torch.from_numpy(words), exposure_s


def gray_exposure_s(ambient: Tensor, sensor: SensorConfig) -> Tensor:
    """Exposure [B] that brings the mean to `gray_target` of full scale, within its limits, s."""
    mean_rate_e_s = ambient.mean(dim=(-2, -1)) * electrons_per_radiance_second(sensor)
    wanted_e = sensor.gray_target * sensor.full_well_e
    # Without any light the quotient is infinite, and the clamp makes the longest exposure of it.
    return (wanted_e / mean_rate_e_s).clamp(SHORTEST_EXPOSURE_S, sensor.gray_max_exposure_s)


def gray_gain_lsb_per_e(sensor: SensorConfig) -> float:
    """Converter gain of the gray image: one full tap is full scale, LSB per electron."""
    return full_scale_lsb(sensor.adc_bits) / sensor.full_well_e


class GrayNoise(NamedTuple):
    """What tells the noise of a sample by the gray image; float32, fields of `noise_by_gray_`."""

    variance_per_word: np.ndarray
    dark: np.float32
    offset_variance: np.ndarray
    offset_per_word: np.ndarray
    most_offset: np.float32


def gray_noise(
    exposure_s: Tensor,
    integration_s: Tensor,
    sensor: SensorConfig,
    *,
    offset_left_lsb: Tensor | None = None,
) -> GrayNoise:
    """The numbers of B frames; see `sample_noise_lsb`."""
    frames = len(exposure_s)
    # Electrons in the gray image, scaled from its exposure time to the sample's, are their own
    # variance: LSB^2 of the sample per word of the gray image.
    gain = sensor.gain_lsb_per_e**2 / gray_gain_lsb_per_e(sensor)
    per_word, left, added = np.empty(frames, np.float32), *np.zeros((2, frames), np.float32)
    # In float64, and rounded once as it is stored.
    time_ratio = integration_s.numpy() / exposure_s.numpy()
    per_word[:] = time_ratio * gain
    if offset_left_lsb is not None:
        left[:] = offset_left_lsb.numpy() ** 2
        per_e = pixel_of(sensor).ambient_lsb_per_e
        added[:] = time_ratio * float(per_e) / gray_gain_lsb_per_e(sensor)
    dark, most = np.float32(dark_variance_lsb2(sensor)), np.float32(sensor.offset_ambient_lsb)
    return GrayNoise(per_word, dark, left, added, most)


def sample_noise_lsb(
    gray: Tensor,
    exposure_s: Tensor,
    integration_s: Tensor,
    sensor: SensorConfig,
    *,
    offset_left_lsb: Tensor | None = None,
) -> Tensor:
    """Noise of one sample as the sensor itself can tell it, float32 [B, H, W], LSB.

    Ambient shot noise, from the gray image, and that of the dark: `sqrt(B + 2 sigma_r^2)`, and
    rounding. The laser's own shot noise is left out; it matters only where the signal is strong
    anyway.

    Parameters
    ----------
    gray : int [B, H, W]
        Words of the gray image.
    exposure_s, integration_s : [B]
        Of the gray image and of a sample, s.
    offset_left_lsb : [B], optional
        Of two samples, in which no offset cancels: standard deviation of what the dark-offset map
        leaves (`offset_left_lsb`). It and what ambient light adds then count as noise, so that two
        samples of nothing are as seldom valid as without any offset.
    """
    exposures_s = exposure_s.expand(len(gray))
    known = gray_noise(exposures_s, integration_s, sensor, offset_left_lsb=offset_left_lsb)
    noise_lsb = np.empty(gray.shape, np.float32)
    noise_by_gray_(long_rows(array(gray, None)), *known, long_rows(noise_lsb))
    return torch.from_numpy(noise_lsb)


def dark_variance_lsb2(sensor: SensorConfig) -> float:
    """Variance of one sample without light: reading two taps, and rounding to words, LSB^2."""
    return 2.0 * (sensor.gain_lsb_per_e * sensor.read_noise_e) ** 2 + ROUNDING_VARIANCE_LSB2
