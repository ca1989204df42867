"""Frames of walls over a floor with samples in closed form, for the tests of networks."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from unwrap.signal.decoding import TWO_PI
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.signal.sensed import Sensed, Truth
from unwrap.signal.shots import Shots, demodulation_phase_rad, frequency_index

HEIGHT, WIDTH = 48, 64
SENSOR = SensorDescription()
AMPLITUDE_LSB, NOISE_LSB = 4000.0, 1.5
SKY_ROWS = 4


class Walls:
    """A source: gray darkens with distance, amplitude falls with its square, the sky is infinite.

    Each frame's wall stands at another distance, 3 to 22 m; noise differs from draw to draw.
    """

    def __init__(self, frames: int = 8, *, range_m: float = 30.0, seed: int = 0):
        self.sensor, self.families, self.range_m = SENSOR, ["garage"] * frames, range_m
        generator = torch.Generator().manual_seed(seed)
        wall_m = 3 + 19 * torch.rand(frames, 1, 1, generator=generator)
        down = torch.linspace(-0.5, 0.5, HEIGHT)[:, None].expand(HEIGHT, WIDTH)
        self.distance_m = torch.minimum(1 / down.clamp(min=1e-3), wall_m)
        self.distance_m[:, :SKY_ROWS] = torch.inf

    def __len__(self) -> int:
        return len(self.families)

    def batch(
        self, numbers: Sequence[int], *, draw: int, shots: Shots | None
    ) -> tuple[Sensed, Truth]:
        distance_m = self.distance_m[list(numbers)]
        # Of draw and frames alone: whoever asks for the same batch again gets the same noise.
        generator = torch.Generator().manual_seed(1000 * draw + sum(numbers))
        noise = torch.randn(len(numbers), 9, HEIGHT, WIDTH, generator=generator)
        gray = 1 / (1 + distance_m.clamp(max=40) / 3) + 0.01 * noise[:, 8]
        sensed = Sensed(gray.clamp(0, 1))
        if shots is not None:
            samples = samples_of(distance_m)[:, :shots] + NOISE_LSB * noise[:, :shots]
            raw = RawFrame(samples, torch.zeros_like(distance_m, dtype=torch.bool))
            sensed = Sensed(sensed.gray, raw, noise_lsb=torch.full_like(distance_m, NOISE_LSB))
        truth_m = distance_m.clamp(max=self.range_m)
        return sensed, Truth(truth_m, torch.ones_like(truth_m, dtype=torch.bool))


def samples_of(distance_m: Tensor) -> Tensor:
    """Noise-free samples [B, 8, H, W] of surfaces [B, H, W]; none comes back from infinity."""
    amplitude = AMPLITUDE_LSB / distance_m.square()
    near_m = distance_m.nan_to_num(posinf=0.0)
    frequencies = (SENSOR.f1_hz, SENSOR.f2_hz)
    waves = []
    for k in range(Shots.EIGHT):
        range_m = unambiguous_range_m(frequencies[frequency_index(k)])
        waves.append(amplitude * torch.cos(TWO_PI / range_m * near_m - demodulation_phase_rad(k)))
    return torch.stack(waves, 1)
