"""The acquisition: light -> electrons -> noise -> full well -> converter -> RawFrame."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.config import SensorConfig
from shotenv.frames import Exposure
from shotenv.sensor.converter import digitise, signed_limits_lsb
from shotenv.sensor.electrons import (
    add_noise,
    clip_to_full_well,
    electrons_per_radiance_second,
    tap_electrons,
)
from shotenv.sensor.offsets import OffsetPattern, ambient_offset_lsb
from unwrap.acquisition import Shots
from unwrap.frames import RawFrame


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
    ValueError
        The light is NaN, infinite or of the wrong shape; the message names the array.
    """
    shots = Shots(shots)
    check_exposure(exposure, laser_power_w, integration_s, noise, shots)
    active_e, ambient_e = collected_electrons(exposure, sensor, laser_power_w, integration_s)
    per_w = _electrons_per_radiance(sensor, integration_s) * laser_power_w[:, None, None]
    scale = (sensor.contrast * per_w).to(active_e.dtype).unsqueeze(1)
    taps = tap_electrons(active_e + ambient_e, exposure.correlation[:, :shots] * scale)
    if noise is not None:
        taps = add_noise(taps, noise[:, :shots], sensor.read_noise_e)
    return read_out(taps, ambient_e, sensor, offsets)


def read_out(
    taps_e: Tensor, ambient_e: Tensor, sensor: SensorConfig, offsets: OffsetPattern | None
) -> RawFrame:
    """Difference of the clipped taps [B, n, 2, H, W], amplified, offset and converted."""
    low, high = signed_limits_lsb(sensor.adc_bits)
    filled = (taps_e >= sensor.full_well_e).flatten(1, 2).any(dim=1)
    held_e = clip_to_full_well(taps_e, sensor.full_well_e)
    analogue_lsb = (held_e[:, :, 0] - held_e[:, :, 1]).mul_(sensor.gain_lsb_per_e)
    if offsets is not None:
        pattern = offsets.pattern_lsb + ambient_offset_lsb(ambient_e, sensor)
        analogue_lsb += pattern.unsqueeze(1)
    dcs_lsb = digitise(analogue_lsb, low, high)
    overflow = (dcs_lsb.abs() >= high).any(dim=1)
    return RawFrame(dcs_lsb, filled | overflow)


def collected_electrons(
    exposure: Exposure, sensor: SensorConfig, laser_power_w: Tensor, integration_s: Tensor
) -> tuple[Tensor, Tensor]:
    """Active S and ambient B [B, H, W], electrons over both taps in one sample."""
    rate = _electrons_per_radiance(sensor, integration_s).to(exposure.ambient.dtype)
    power = laser_power_w[:, None, None].to(exposure.ambient.dtype)
    return exposure.active * (rate * power), exposure.ambient * rate


def single_sample_snr(active_e: Tensor, ambient_e: Tensor, sensor: SensorConfig) -> Tensor:
    """Signal-to-noise ratio of one sample, `m S / sqrt(S + B + 2 sigma_r^2)`."""
    variance = (active_e + ambient_e).add_(2.0 * sensor.read_noise_e**2)
    return variance.rsqrt_().mul_(active_e).mul_(sensor.contrast)


def _electrons_per_radiance(sensor: SensorConfig, integration_s: Tensor) -> Tensor:
    return (electrons_per_radiance_second(sensor) * integration_s)[:, None, None]


def check_exposure(
    exposure: Exposure,
    laser_power_w: Tensor,
    integration_s: Tensor,
    noise: Tensor | None,
    shots: Shots,
) -> None:
    """Refuse light and settings that cannot be acquired.

    Raises
    ------
    ValueError
        A shape that does not fit, a negative setting or a value that is not finite.
    """
    batch, samples, height, width = exposure.correlation.shape
    if samples < shots:
        raise ValueError(f"correlation has {samples} samples; expected at least {int(shots)}")
    maps = {"active": exposure.active, "ambient": exposure.ambient}
    for name, value in maps.items():
        if value.shape != (batch, height, width):
            raise ValueError(f"{name} is {tuple(value.shape)}; expected {(batch, height, width)}")
    for name, value in {"laser_power_w": laser_power_w, "integration_s": integration_s}.items():
        if value.shape != (batch,) or not bool(((value >= 0) & torch.isfinite(value)).all()):
            raise ValueError(f"{name} is {value.tolist()}; expected {batch} finite values >= 0")
    if noise is not None and (noise.ndim != 5 or noise.shape[1] < shots):
        raise ValueError(
            f"noise is {tuple(noise.shape)}; expected {(batch, int(shots), 2, height, width)}"
        )
    for name, value in {"correlation": exposure.correlation[:, :shots], **maps}.items():
        # A sum is NaN or infinite as soon as one term is: one pass instead of three.
        if not bool(torch.isfinite(value.sum())):
            raise ValueError(f"{name} holds NaN or infinity; expected finite radiance")
