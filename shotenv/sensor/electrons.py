"""Light to electrons, with the noise and the limits of a charge packet.

Each function is one effect; a parameter at zero (or an infinite full well) switches it off.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from shotenv.config import SensorConfig

PLANCK_J_S = 6.62607015e-34
SPEED_OF_LIGHT_M_S = 299_792_458.0


def photon_energy_j(wavelength_nm: float) -> float:
    """Energy h c / lambda of one photon, joules."""
    return PLANCK_J_S * SPEED_OF_LIGHT_M_S / (wavelength_nm * 1e-9)


def electrons_per_radiance_second(sensor: SensorConfig) -> float:
    """Electrons that a pixel collects in one second from a radiance of 1 W m-2 sr-1.

    Camera equation: the irradiance behind a lens of f-number N and transmission tau is
    `pi L tau / (4 N^2)`; times light-sensitive area, over photon energy, times QE.
    """
    irradiance = math.pi * sensor.lens_transmission / (4.0 * sensor.f_number**2)
    area_m2 = sensor.fill_factor * sensor.pixel_pitch_m**2
    per_photon = sensor.quantum_efficiency / photon_energy_j(sensor.wavelength_nm)
    return irradiance * area_m2 * per_photon


def tap_packets(
    mean_e: Tensor,
    correlation: Tensor,
    per_correlation_e: Tensor,
    contrast: float,
    *,
    out: tuple[Tensor, Tensor],
) -> None:
    """Charge of both taps in one sample plus the variance of reading it, `(S + B +- m C_k) / 2`.

    With the read noise's variance added a packet is its own variance (Poisson's equals the mean),
    and the difference of two taps is that of their charges.

    Parameters
    ----------
    mean_e : [B, H, W]
        Half of the electrons over both taps and the variance of reading, (S + B) / 2 + sigma_r^2.
    correlation : [B, H, W]
        Correlation of the light with the sample's demodulation, in any unit.
    per_correlation_e : [B, 1, 1]
        Electrons of one sample per unit of `correlation`.
    contrast : float
        Demodulation contrast m.
    out : two of [B, H, W]
        Become the packets of tap A and of tap B.
    """
    for tap_e, half in zip(out, (0.5, -0.5), strict=True):
        torch.addcmul(mean_e, correlation, per_correlation_e, value=half * contrast, out=tap_e)


def keep_positive(packets_e: Tensor, read_variance_e: float) -> Tensor:
    """Packets in place, of charges that are not negative: a sample may differ from the mean."""
    return packets_e.clamp_(min=read_variance_e)


def add_noise(packets_e: Tensor, normals: Tensor) -> Tensor:
    """Shot and read noise added in place: one normal per packet, which is its own variance.

    The normal distribution stands for Poisson's: one variate per packet keeps the noise stream
    in step whatever the light is.
    """
    # Over the reciprocal root: torch takes that one faster than the root.
    return packets_e.addcdiv_(normals, packets_e.rsqrt())


def clip_to_full_well(charge_e: Tensor, full_well_e: float) -> Tensor:
    """Charge limited in place to what a tap can hold; read noise may take it below zero."""
    return charge_e.clamp_(max=full_well_e)
