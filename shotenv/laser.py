"""The laser: what a frame costs in energy and heat, and when the laser trips.

The functions are made of arithmetic alone and take torch tensors and NumPy arrays alike.
"""

from __future__ import annotations

import math
from typing import Any

from torch import Tensor

from shotenv.config import LaserConfig
from shotenv.frames import ShotCost

Array = Any


def shot_cost(
    shots: Tensor,
    laser: LaserConfig,
    *,
    optical_power_w: Tensor,
    integration_s: Tensor,
    frame_period_s: float,
    network_macs: float,
) -> ShotCost:
    """Energy, duty and heat of one frame.

    Laser, modulation driver and readouts go with the samples, one readout more with the gray
    image; the imager's static power with the frame period; the network is run where the shots do
    not unwrap by themselves, with 2 and 4 samples.

    Parameters
    ----------
    shots : int64 [B]
        0 (laser off), 2, 4 or 8.
    optical_power_w, integration_s : float64 [B]
        Laser power while on, W; time of one sample, s.
    frame_period_s : float
        Seconds from frame to frame.
    network_macs : float
        Multiply-accumulates of one prediction.
    """
    on_s = shots * integration_s
    laser_j = on_s * optical_power_w / laser.efficiency
    readout_j = (shots + 1) * laser.readout_energy_j
    network_j = ((shots == 2) | (shots == 4)) * (network_macs * laser.energy_per_mac_j)
    static_j = laser.static_power_w * frame_period_s
    return ShotCost(
        laser_energy_j=laser_j,
        energy_j=laser_j + on_s * laser.driver_power_w + readout_j + network_j + static_j,
        duty=on_s / frame_period_s,
        heat_j=laser_j * (1.0 - laser.efficiency),
    )


def thermal_step(
    temperature_k: Array, heat_j: Array, ambient_k: Array, laser: LaserConfig, period_s: float
) -> Array:
    """Temperature one frame later, kelvin.

    The exact solution of `tau dT/dt = ambient + R P - T` for a heat flow P = heat / period that
    is constant over the frame.
    """
    steady_k = ambient_k + laser.thermal_resistance_k_per_w * heat_j / period_s
    return steady_k + (temperature_k - steady_k) * math.exp(
        -period_s / laser.thermal_time_constant_s
    )


def trip_step(tripped: Array, temperature_k: Array, laser: LaserConfig) -> Array:
    """Whether the laser is off in the next frame: on at `trip_k`, back below `release_k`."""
    return (temperature_k >= laser.trip_k) | (tripped & (temperature_k >= laser.release_k))
