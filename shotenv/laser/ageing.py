"""Wear: how much faster than rated the laser ages."""

from __future__ import annotations

from typing import Any

import numpy as np

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
    exponent = 0.0
    if laser.ageing_exponent:
        # What the rated current takes: the light's power at 25 C over the efficiency there.
        rated_w = laser.rated_power_w / laser.efficiency
        exponent = laser.ageing_exponent * _log(electrical_power_w / rated_w)
    if laser.activation_energy_ev:
        activation_k = laser.activation_energy_ev / BOLTZMANN_EV_PER_K
        exponent = exponent + activation_k / laser.rated_k - activation_k / temperature_k
    return _exp(exponent)


# Not `**`: torch rounds the last elements of a batch otherwise than those before, and what a drive
# wears would depend on how many are played beside it. NumPy and torch have these functions each for
# their own arrays alone.
def _log(values: Array) -> Array:
    return values.log() if hasattr(values, "log") else np.log(values)


def _exp(values: Array) -> Array:
    return values.exp() if hasattr(values, "exp") else np.exp(values)
