"""Heat: two thermal stages, and the trip.

The network of the data sheets (Foster): the whole heat flow passes each stage, so that the stages
add up and each is solved exactly for a flow that is constant over the frame.
"""

from __future__ import annotations

import math
from typing import Any

from shotenv.config import LaserConfig

Array = Any


def relaxed(value: Array, steady: Array, time_constant_s: float, period_s: float) -> Array:
    """Exact solution of `tau dx/dt = steady - x` after `period_s`, from `value`."""
    # Exact for any period: an Euler step would overshoot where the period nears the time constant.
    return steady + (value - steady) * math.exp(-period_s / time_constant_s)


def case_step(
    case_k: Array, heat_j: Array, ambient_k: Array, laser: LaserConfig, period_s: float
) -> Array:
    """Temperature of the case one frame later, kelvin, for a heat flow of heat / period."""
    steady_k = ambient_k + heat_j * (laser.thermal_resistance_k_per_w / period_s)
    return relaxed(case_k, steady_k, laser.thermal_time_constant_s, period_s)


def junction_step(rise_k: Array, heat_j: Array, laser: LaserConfig, period_s: float) -> Array:
    """Rise of the junction above the case one frame later, kelvin."""
    steady_k = heat_j * (laser.junction_resistance_k_per_w / period_s)
    return relaxed(rise_k, steady_k, laser.junction_time_constant_s, period_s)


def trip_step(tripped: Array, temperature_k: Array, laser: LaserConfig) -> Array:
    """Whether the laser is off in the next frame: on at `trip_k`, back below `release_k`."""
    # Two thresholds: with a single one the laser would go on and off in turn at its limit.
    return (temperature_k >= laser.trip_k) | (tripped & (temperature_k >= laser.release_k))
