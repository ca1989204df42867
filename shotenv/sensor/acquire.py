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
    mean_e = (active_e + ambient_e).mul_(0.5)
    per_w = _electrons_per_radiance(sensor, integration_s) * laser_power_w[:, None, None]
    half_scale = (0.5 * sensor.contrast * per_w).to(mean_e.dtype)
    pattern_lsb = fixed_pattern_lsb(ambient_e, sensor, offsets)
    dcs_lsb = torch.empty_like(exposure.correlation[:, :shots])
    saturated = torch.zeros_like(mean_e, dtype=torch.bool)
    # One sample at a time keeps the working set in cache: measured 3 x faster than all at once.
    for k in range(shots):
        taps_e = tap_electrons(mean_e, exposure.correlation[:, k] * half_scale)
        if noise is not None:
            taps_e = add_noise(taps_e, noise[:, k], sensor.read_noise_e)
        dcs_lsb[:, k], filled = read_out(taps_e, pattern_lsb, sensor)
        saturated |= filled
    return RawFrame(dcs_lsb, saturated)


def read_out(
    taps_e: Tensor, pattern_lsb: Tensor | float, sensor: SensorConfig
) -> tuple[Tensor, Tensor]:
    """Words of one sample from its taps [B, 2, H, W].

    Each tap clips at its full well *before* the difference; then gain, offset, rounding and the
    converter's range.

    Returns
    -------
    dcs_lsb : [B, H, W]
        Signed words.
    saturated : bool [B, H, W]
        A tap was full or the word is at a limit of the range.
    """
    low, high = signed_limits_lsb(sensor.adc_bits)
    filled = torch.maximum(taps_e[:, 0], taps_e[:, 1]) >= sensor.full_well_e
    held_e = clip_to_full_well(taps_e, sensor.full_well_e)
    analogue_lsb = (held_e[:, 0] - held_e[:, 1]).mul_(sensor.gain_lsb_per_e).add_(pattern_lsb)
    dcs_lsb = digitise(analogue_lsb, low, high)
    return dcs_lsb, filled.logical_or_(dcs_lsb.abs() >= high)


def fixed_pattern_lsb(
    ambient_e: Tensor, sensor: SensorConfig, offsets: OffsetPattern | None
) -> Tensor | float:
    """Offset added to every sample: the taps' pattern and what ambient adds; 0 without offsets."""
    if offsets is None:
        return 0.0
    return ambient_offset_lsb(ambient_e, sensor).add_(offsets.pattern_lsb)


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
