"""The acquisition: light -> electrons -> noise -> full well -> converter -> RawFrame."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import repeat

import torch
from torch import Tensor

from shotenv.config import SensorConfig
from shotenv.frames import Exposure
from shotenv.sensor.converter import digitise, signed_limits_lsb
from shotenv.sensor.electrons import (
    add_noise,
    clip_to_full_well,
    electrons_per_radiance_second,
    keep_positive,
    tap_packets,
)
from shotenv.sensor.offsets import OffsetPattern, add_ambient_offset
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
    check_exposure(exposure, shots)
    check_settings(exposure, shots, laser_power_w, integration_s, noise)
    electrons = collect(exposure, sensor, laser_power_w, integration_s)
    samples = None if noise is None else noise.unbind(1)
    return acquire(electrons, sensor, shots=shots, noise=samples, offsets=offsets)


@dataclass(frozen=True)
class Electrons:
    """Noise-free charge of a batch of frames, at the laser power and integration time chosen.

    Attributes
    ----------
    active_e, ambient_e : float32 [B, H, W]
        Active S and ambient B, electrons over both taps in one sample.
    mean_e : float32 [B, H, W]
        Of a tap's packet, the variance of reading it included: (S + B) / 2 + sigma_r^2.
    correlation : float32 [B, 8, H, W]
        As in `Exposure`.
    per_correlation_e : float32 [B, 1, 1]
        Electrons of one sample per unit of `correlation`.
    """

    active_e: Tensor
    ambient_e: Tensor
    mean_e: Tensor
    correlation: Tensor
    per_correlation_e: Tensor


@dataclass(frozen=True)
class Sensitivity:
    """Electrons of one sample per unit of light, at a laser power and integration time.

    Attributes
    ----------
    ambient_e : float32 [B, 1, 1]
        Per W m-2 sr-1 of ambient radiance.
    active_e : float32 [B, 1, 1]
        Per W m-2 sr-1 and watt of active radiance and its correlation.
    """

    ambient_e: Tensor
    active_e: Tensor


def sensitivity(sensor: SensorConfig, laser_power_w: Tensor, integration_s: Tensor) -> Sensitivity:
    """Sensitivity at a laser power and an integration time, each [B]."""
    ambient_e = electrons_per_radiance_second(sensor) * integration_s
    both = (ambient_e, ambient_e * laser_power_w)
    return Sensitivity(*(value.to(torch.float32).view(-1, 1, 1) for value in both))


def charge(exposure: Exposure, sensor: SensorConfig, per_light: Sensitivity) -> Electrons:
    """Electrons that each pixel collects in one sample, with a sensitivity that is known."""
    active_e = exposure.active * per_light.active_e
    ambient_e = exposure.ambient * per_light.ambient_e
    mean_e = torch.lerp(active_e, ambient_e, 0.5).add_(sensor.read_noise_e**2)
    return Electrons(active_e, ambient_e, mean_e, exposure.correlation, per_light.active_e)


def collect(
    exposure: Exposure, sensor: SensorConfig, laser_power_w: Tensor, integration_s: Tensor
) -> Electrons:
    """Electrons that each pixel collects in one sample."""
    return charge(exposure, sensor, sensitivity(sensor, laser_power_w, integration_s))


def acquire(
    electrons: Electrons,
    sensor: SensorConfig,
    *,
    shots: Shots,
    noise: Iterable[Tensor] | None,
    offsets: OffsetPattern | None,
) -> RawFrame:
    """Noise, full well and converter for charge that is known to be sound; see `expose`.

    Sample after sample, so that what one sample needs stays in the processor's cache; `noise`
    gives the normals [B, 2, H, W] of each.
    """
    mean_e, per_correlation_e = electrons.mean_e, electrons.per_correlation_e
    read_variance_e = sensor.read_noise_e**2
    full_e = sensor.full_well_e + read_variance_e
    pattern_lsb = fixed_pattern_lsb(electrons.ambient_e, sensor, offsets)
    batch, height, width = mean_e.shape
    dcs_lsb = mean_e.new_empty(batch, int(shots), height, width)
    taps_e = mean_e.new_empty(batch, 2, height, width)
    tap_a_e, tap_b_e = taps_e.unbind(1)
    fullest_e = torch.zeros_like(taps_e)
    samples = zip(
        dcs_lsb.unbind(1),
        electrons.correlation.unbind(1),
        repeat(None) if noise is None else noise,
        strict=False,
    )
    for sample_lsb, correlation, normals in samples:
        tap_packets(mean_e, correlation, per_correlation_e, sensor.contrast, out=(tap_a_e, tap_b_e))
        keep_positive(taps_e, read_variance_e)
        if normals is not None:
            add_noise(taps_e, normals)
        clip_to_full_well(taps_e, full_e)
        torch.maximum(taps_e, fullest_e, out=fullest_e)
        read_out(tap_a_e, tap_b_e, pattern_lsb, sensor, out=sample_lsb)
    digitise(dcs_lsb, *signed_limits_lsb(sensor.adc_bits))
    return RawFrame(dcs_lsb, _saturated(fullest_e, full_e, dcs_lsb, sensor))


def read_out(
    tap_a_e: Tensor, tap_b_e: Tensor, pattern_lsb: Tensor, sensor: SensorConfig, *, out: Tensor
) -> None:
    """What the converter is given of a sample's taps [B, H, W], LSB [B, H, W].

    The taps' difference, then gain and offset.
    """
    torch.sub(tap_a_e, tap_b_e, out=out)
    torch.add(pattern_lsb, out, alpha=sensor.gain_lsb_per_e, out=out)


def _saturated(fullest_e: Tensor, full_e: float, dcs_lsb: Tensor, sensor: SensorConfig) -> Tensor:
    """Where the fuller tap of some sample was full, or its word is at a limit of the range."""
    low, high = signed_limits_lsb(sensor.adc_bits)
    # In place a comparison stays float32, which is vectorised; a bool result is not.
    beyond = fullest_e.amax(dim=1).ge_(full_e)
    beyond.add_(dcs_lsb.amax(dim=1).ge_(high))
    return beyond.add_(dcs_lsb.amin(dim=1).le_(low)).bool()


def fixed_pattern_lsb(
    ambient_e: Tensor, sensor: SensorConfig, offsets: OffsetPattern | None
) -> Tensor:
    """Offset [B, H, W] of every sample: the taps' pattern and what ambient adds; or 0."""
    if offsets is None:
        return ambient_e.new_zeros(())
    return add_ambient_offset(offsets.pattern_lsb, ambient_e, sensor)


def single_sample_snr(electrons: Electrons, sensor: SensorConfig) -> Tensor:
    """Noise-free signal to noise of one sample [B, H, W]: `m S / sqrt(S + B + 2 sigma_r^2)`."""
    signal_e = electrons.mean_e.rsqrt().mul_(electrons.active_e)
    return signal_e.mul_(math.sqrt(0.5) * sensor.contrast)


def check_exposure(exposure: Exposure, shots: Shots) -> None:
    """Refuse light that cannot be acquired.

    Raises
    ------
    ValueError
        Too few samples, a shape that does not fit, NaN or infinity; the message names the array.
    """
    batch, samples, height, width = exposure.correlation.shape
    if samples < shots:
        raise ValueError(f"correlation has {samples} samples; expected at least {int(shots)}")
    maps = {"active": exposure.active, "ambient": exposure.ambient}
    for name, value in maps.items():
        if value.shape != (batch, height, width):
            raise ValueError(f"{name} is {tuple(value.shape)}; expected {(batch, height, width)}")
        if not bool((value >= 0).all()):
            raise ValueError(f"{name} holds NaN or a negative radiance; expected finite values")
    for name, value in {"correlation": exposure.correlation[:, :shots], **maps}.items():
        if not bool(torch.isfinite(value).all()):
            raise ValueError(f"{name} holds NaN or infinity; expected finite radiance")


def check_settings(
    exposure: Exposure,
    shots: Shots,
    laser_power_w: Tensor,
    integration_s: Tensor,
    noise: Tensor | None,
) -> None:
    """Refuse laser power, integration time or noise that do not fit the light.

    Raises
    ------
    ValueError
        A shape that does not fit, a negative or not finite setting; the message names it.
    """
    batch, _, height, width = exposure.correlation.shape
    for name, value in {"laser_power_w": laser_power_w, "integration_s": integration_s}.items():
        if value.shape != (batch,) or not bool(((value >= 0) & torch.isfinite(value)).all()):
            raise ValueError(f"{name} is {value.tolist()}; expected {batch} finite values >= 0")
    if noise is None:
        return
    expected = (batch, int(shots), 2, height, width)
    fits = noise.ndim == 5 and noise[:, :shots].shape == expected
    if not fits or not bool(torch.isfinite(noise).all()):
        raise ValueError(f"noise is {tuple(noise.shape)}; expected finite normals {expected}")
