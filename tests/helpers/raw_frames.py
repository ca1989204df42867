"""Samples of static scenes without noise."""

import torch

from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame

SENSOR = SensorDescription()
RANGE_M = 299_792_458.0 / 48e6


def raw_frame(distance_m, count, amplitude=200.0):
    """Noise-free samples of a static scene."""
    samples = []
    for k in range(count):
        frequency = SENSOR.f1_hz if k < 4 else SENSOR.f2_hz
        phase = 4 * torch.pi * frequency * distance_m / 299_792_458.0
        samples.append(amplitude * torch.cos(phase - (k % 4) * torch.pi / 2))
    return RawFrame(torch.stack(samples, 1).float(), torch.zeros_like(distance_m).bool())
