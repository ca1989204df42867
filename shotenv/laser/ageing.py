"""Wear: how much faster than rated the laser ages."""

from __future__ import annotations

import math
from typing import Any

from shotenv.config import LaserConfig

Array = Any
BOLTZMANN_EV_PER_K = 8.617333262e-5


def ageing_rate(electrical_power_w: Array, temperature_k: Array, laser: LaserConfig) -> Array:
    """Hours of the rated life that one hour of light uses up.

    `(I / I0)^n exp(Ea / k (1 / T0 - 1 / T))`: current to a power, and Arrhenius. The published fit
    to oxide-confined VCSELs has n = 2.01 and Ea = 0.55 eV; Ea = 0.7 eV is a common default. At
    a constant forward voltage, which is assumed, the current ratio is that of electrical powers.

    Parameters
    ----------
    electrical_power_w : [B]
        While on, W. The rated current makes `rated_power_w` of light at 25 C.
    temperature_k : [B]
        Of the junction.
    """
    return _current(electrical_power_w, laser) * _arrhenius(temperature_k, laser)


def _current(electrical_power_w: Array, laser: LaserConfig) -> Array:
    if not laser.ageing_exponent:
        return 1.0
    # What the rated current takes: the light's power at 25 C over the efficiency there.
    rated_w = laser.rated_power_w / laser.efficiency
    return (electrical_power_w / rated_w) ** laser.ageing_exponent


def _arrhenius(temperature_k: Array, laser: LaserConfig) -> Array:
    if not laser.activation_energy_ev:
        return 1.0
    activation_k = laser.activation_energy_ev / BOLTZMANN_EV_PER_K
    # Not `exp`, which NumPy and torch each have for their own arrays alone.
    return math.e ** (activation_k / laser.rated_k - activation_k / temperature_k)
