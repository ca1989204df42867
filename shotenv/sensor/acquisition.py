"""The acquisition: light -> electrons -> noise -> full well -> converter -> RawFrame."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import repeat

import numpy as np
import torch
from torch import Tensor

from shotenv.config import SensorConfig
from shotenv.sensor.acquisition_checks import check_acquisition
from shotenv.sensor.converter import signed_limits_lsb
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.offsets import OffsetPattern
from shotenv.sensor.pixel_loops import IncidentLight, Pixel, mark_scored_, take_sample_
from unwrap.signal import RawFrame, Shots
from unwrap.support import array, long_rows


def expose(
    exposure: Exposure,
    sensor: SensorConfig,
    *,
    shots: Shots,
    laser_power_w: Tensor,
    integration_s: Tensor,
    noise: Tensor | None,
    offsets: OffsetPattern | None,
) -> RawFrame:
    """Acquire a batch of frames with `shots` samples each.

    Parameters
    ----------
    exposure : Exposure
        Noise-free light, batch B.
    sensor : SensorConfig
        The imager.
    shots : Shots
        2, 4 or 8 samples; the first samples of `exposure.correlation` are taken.
    laser_power_w, integration_s : [B]
        Optical power while on, W, and integration time of one sample, s.
    noise : float32 [B, n, 2, H, W] or None
        Standard normals of tap A and tap B, n >= shots; None leaves shot and read noise out.
    offsets : OffsetPattern or None
        Fixed pattern; None leaves it out, its ambient part too.

    Raises
    ------
    TypeError, ValueError
        An argument is of another kind or shape, or holds NaN or a number beyond what a sensor could
        meet; the message names it.
    """
    check_acquisition(exposure, sensor, shots, laser_power_w, integration_s, noise, offsets)
    shots = Shots(shots)
    # `acquire` takes noise sample by sample, as the streams draw it.
    samples = None if noise is None else noise.unbind(1)
    light = incident_light(exposure, sensitivity(sensor, laser_power_w, integration_s))
    return acquire(light, sensor, shots=shots, noise=samples, offsets=offsets)


ACQUISITIONS = frozenset(int(shots) for shots in Shots)


@dataclass(frozen=True)
class Sensitivity:
    """Electrons of one sample per unit of light, at a laser power and integration time.

    Attributes
    ----------
    ambient_e : float32 [B]
        Per W m-2 sr-1 of ambient radiance.
    active_e : float32 [B]
        Per W m-2 sr-1 and watt of active radiance and its correlation.
    """

    ambient_e: Tensor
    active_e: Tensor


def sensitivity(sensor: SensorConfig, laser_power_w: Tensor, integration_s: Tensor) -> Sensitivity:
    """Sensitivity at a laser power and an integration time, each [B]."""
    ambient_e = electrons_per_radiance_second(sensor) * integration_s
    # A bank's active light is per watt of the laser.
    active_e = ambient_e * laser_power_w
    return Sensitivity(ambient_e.to(torch.float32), active_e.to(torch.float32))


def acquire(
    light: IncidentLight,
    sensor: SensorConfig,
    *,
    shots: Shots,
    noise: Iterable[Tensor] | None,
    offsets: OffsetPattern | None,
) -> RawFrame:
    """Noise, full well and converter for light that is known to be sound; see `expose`.

    Sample after sample, so that what one sample needs stays in the processor's cache; `noise`
    gives the normals [B, 2, H, W] of each.
    """
    return acquire_prefixes(light, sensor, shots=shots, noise=noise, offsets=offsets)[shots]


def acquire_prefixes(
    light: IncidentLight,
    sensor: SensorConfig,
    *,
    shots: Shots,
    noise: Iterable[Tensor] | None,
    offsets: OffsetPattern | None,
) -> dict[Shots, RawFrame]:
    """As `acquire`, with the shorter acquisitions that are in this one.

    A frame of eight samples is also one of its first two and one of its first four.
    """
    batch, height, width = light.active.shape
    dcs_lsb = np.empty((batch, int(shots), height, width), np.float32)
    saturated = np.zeros((batch, height, width), np.bool_)
    taken: dict[Shots, RawFrame] = {}
    for count in _samples_taken(light, sensor, noise, offsets, dcs_lsb, saturated):
        if count in ACQUISITIONS:
            # A copy: the samples to come go on marking pixels.
            samples = torch.from_numpy(dcs_lsb[:, :count])
            taken[Shots(count)] = RawFrame(samples, torch.from_numpy(saturated.copy()))
    return taken


def acquire_flagged(
    light: IncidentLight,
    sensor: SensorConfig,
    *,
    shots: Shots,
    noise: Iterable[Tensor] | None,
    offsets: OffsetPattern | None,
) -> tuple[Tensor, Tensor]:
    """As `acquire`, with a flag for each sample: both [B, n, H, W], float32 in LSB and bool.

    A pixel of `RawFrame` is saturated where any of its samples is.
    """
    batch, height, width = light.active.shape
    dcs_lsb = np.empty((batch, int(shots), height, width), np.float32)
    saturated, flags = np.zeros((batch, height, width), np.bool_), np.empty(dcs_lsb.shape, np.bool_)
    for count in _samples_taken(light, sensor, noise, offsets, dcs_lsb, saturated):
        flags[:, count - 1] = saturated
        saturated[:] = False
    return torch.from_numpy(dcs_lsb), torch.from_numpy(flags)


def _samples_taken(
    light: IncidentLight,
    sensor: SensorConfig,
    noise: Iterable[Tensor] | None,
    offsets: OffsetPattern | None,
    dcs_lsb: np.ndarray,
    saturated: np.ndarray,
) -> Iterator[int]:
    """Write sample after sample into `dcs_lsb` [B, n, H, W], marking `saturated` [B, H, W].

    Yields
    ------
    int
        How many are taken.
    """
    shape = batch, height, width = light.active.shape
    pixel = pixel_of(sensor)
    if offsets is None:
        # The part that ambient light adds belongs to the pattern, and is left out with it.
        offsets = OffsetPattern(torch.zeros(shape), torch.zeros(shape))
        pixel = pixel._replace(ambient_lsb_per_e=np.float32(0))
    if noise is None:
        pixel = pixel._replace(shot_noise=np.float32(0))
        noise = repeat(torch.zeros(batch, 2, height, width))
    # A compiled loop does not broadcast, and reads on where an array ends: shapes are made equal
    # here, where a wrong one is still an error.
    pattern_lsb = array(offsets.pattern_lsb.expand(shape))
    lit = light._replace(
        correlation=long_rows(light.correlation),
        active=long_rows(light.active),
        ambient=long_rows(light.ambient),
    )
    fixed = long_rows(pattern_lsb), long_rows(row_parity(height, width)), pixel
    made = long_rows(dcs_lsb), long_rows(saturated)
    for number, normals in zip(range(dcs_lsb.shape[1]), noise, strict=False):
        take_sample_(number, lit, long_rows(array(normals)), *fixed, *made)
        yield number + 1


@lru_cache(maxsize=16)
def row_parity(height: int, width: int) -> np.ndarray:
    """1 in even and -1 in odd rows, float32 [H, W]; kept, since every acquisition asks for it."""
    sign = np.ones((height, width), np.float32)
    sign[1::2] = -1.0
    return sign


def scored_pixels(light: IncidentLight, truth_m: Tensor, sensor: SensorConfig) -> Tensor:
    """Pixels that count, bool [B, H, W], whatever is measured there.

    Truth [B, H, W] within `max_range_m`, noise-free signal to noise of one sample,
    `m S / sqrt(S + B + 2 sigma_r^2)`, above `min_snr`.

    Raises
    ------
    ValueError
        The truth is not of the light's shape.
    """
    if truth_m.shape != light.active.shape:
        raise ValueError(f"truth_m is {tuple(truth_m.shape)}; expected {light.active.shape}")
    scored = np.empty(light.active.shape, np.bool_)
    # float32, as everything in the loops; see `unwrap.support.loop`.
    limits = np.float32(sensor.max_range_m), np.float32(sensor.min_snr)
    lit = light._replace(active=long_rows(light.active), ambient=long_rows(light.ambient))
    mark_scored_(lit, pixel_of(sensor), long_rows(array(truth_m)), *limits, long_rows(scored))
    return torch.from_numpy(scored)


def incident_light(exposure: Exposure, per_light: Sensitivity) -> IncidentLight:
    """Light as the loops over pixels take it: arrays, with their worth in electrons."""
    return IncidentLight(
        correlation=array(exposure.correlation),
        active=array(exposure.active),
        ambient=array(exposure.ambient),
        active_e=array(per_light.active_e),
        ambient_e=array(per_light.ambient_e),
    )


@lru_cache(maxsize=64)
def pixel_of(sensor: SensorConfig) -> Pixel:
    """Constants that the loops over pixels need of a sensor; kept, for every acquisition asks."""
    low_lsb, high_lsb = signed_limits_lsb(sensor.adc_bits)
    return Pixel(
        contrast=np.float32(sensor.contrast),
        read_variance_e=np.float32(sensor.read_noise_e**2),
        full_well_e=np.float32(sensor.full_well_e),
        gain_lsb_per_e=np.float32(sensor.gain_lsb_per_e),
        # At a full well in both taps it is `offset_ambient_lsb`.
        ambient_lsb_per_e=np.float32(sensor.offset_ambient_lsb / (2.0 * sensor.full_well_e)),
        low_lsb=np.float32(low_lsb),
        high_lsb=np.float32(high_lsb),
    )
