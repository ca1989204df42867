"""Light to electrons: the camera equation."""

from __future__ import annotations

import math

from shotenv.config import SensorConfig
from unwrap.signal import SPEED_OF_LIGHT_M_S

PLANCK_J_S = 6.62607015e-34
"""Exact, by the definition of the kilogram (SI, 2019)."""


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
