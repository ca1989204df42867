"""Samples of walls at known distances, from closed forms, for the tests of the peers."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed, Truth
from unwrap.signal.shots import demodulation_phase_rad, frequency_index

SPEED_OF_LIGHT_M_S = 299_792_458.0
UNAMBIGUOUS_M = SPEED_OF_LIGHT_M_S / 48e6
SENSOR = SensorDescription()


def samples(
    distance_m: Tensor, amplitude: Tensor | float, shots: int, noise_lsb: float = 0.0, seed: int = 0
) -> RawFrame:
    """Samples [B, shots, H, W] of surfaces at `distance_m` [B, H, W], with Gaussian noise."""
    frequencies = (SENSOR.f1_hz, SENSOR.f2_hz)
    angles = [
        4 * math.pi * frequencies[frequency_index(k)] / SPEED_OF_LIGHT_M_S * distance_m.double()
        - demodulation_phase_rad(k)
        for k in range(shots)
    ]
    clean = torch.stack([amplitude * angle.cos() for angle in angles], 1).float()
    noise = torch.randn(clean.shape, generator=torch.Generator().manual_seed(seed))
    dcs_lsb = clean + noise_lsb * noise
    return RawFrame(dcs_lsb, torch.zeros_like(distance_m, dtype=torch.bool))


def steps(height: int = 48, width: int = 64) -> Tensor:
    """Distances [2, H, W]: a near and a far wall with a box each; wraps 0, 1, 2 and 3."""
    distance = torch.empty(2, height, width)
    distance[0], distance[1] = 9.0, 15.0
    distance[0, height // 4 : height * 3 // 4, width // 4 : width // 2] = 3.0
    distance[1, height // 4 : height * 3 // 4, width // 2 : width * 3 // 4] = 21.0
    # A floor that draws nearer, across a wrap.
    floor = torch.linspace(8.0, 4.0, height // 4)[:, None]
    distance[:, -(height // 4) :] = floor
    return distance


def wraps_of(distance_m: Tensor) -> Tensor:
    """Whole unambiguous ranges in a distance."""
    return (distance_m / UNAMBIGUOUS_M).long()


def batch(shots: int, height: int = 48, width: int = 64) -> tuple[Sensed, Truth]:
    """Two frames of `steps` with a little noise; gray follows the amplitude."""
    distance_m = steps(height, width)
    amplitude = 4000.0 / distance_m.square()
    raw = samples(distance_m, amplitude, shots, noise_lsb=0.5)
    sensed = Sensed(
        gray=(amplitude / 500).clamp(max=1),
        raw=raw,
        offset_lsb=torch.zeros_like(distance_m),
        noise_lsb=torch.full_like(distance_m, 0.5),
        shift_m=torch.zeros(len(distance_m), dtype=torch.float64),
    )
    return sensed, Truth(distance_m, torch.ones_like(distance_m, dtype=torch.bool))
