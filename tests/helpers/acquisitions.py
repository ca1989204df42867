"""Frames acquired as most tests of the sensor want them: fixed laser power, noise as given."""

from __future__ import annotations

import torch

from shotenv.sensor.acquisition import expose
from unwrap.signal.shots import Shots

POWER_W, INTEGRATION_S = 7.0, 6e-4


def acquired(exposure, sensor, shots=Shots.FOUR, *, noise=None, offsets=None):
    """Raw samples of one frame; without noise and offsets unless they are given."""
    one = torch.ones(1, dtype=torch.float64)
    return expose(
        exposure,
        sensor,
        shots=shots,
        laser_power_w=POWER_W * one,
        integration_s=INTEGRATION_S * one,
        noise=noise,
        offsets=offsets,
    )
