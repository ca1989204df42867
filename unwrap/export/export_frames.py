"""Frames that an exported network is checked and calibrated with, and such frames made up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn import functional

from unwrap.signal import (
    GRAY_FULL_SCALE,
    TWO_PI,
    RawFrame,
    Sensed,
    SensorDescription,
    Shots,
    correlation_samples,
    sample_noise_lsb,
    unambiguous_range_m,
    wrapped_distance_m,
)
from unwrap.support import mapped

OCTAVES = (4, 8, 16, 32)
"""Details of made-up images: grids of so many cells down and across."""
LARGEST_WORD = 2047
"""Of a 12-bit converter, about its mid-scale."""
FARTHEST_M = 30.0
"""Largest distance made up: beyond the range of the sensors, so that every wrap occurs."""


@dataclass(frozen=True)
class ExportFrames:
    """Inputs of an exported network, and what is true of them.

    Attributes
    ----------
    source : str
        Where they come from, in words.
    inputs : mapping of str to Tensor [N, ...]
        What the file takes, by name: those of `forward` in `unwrap.export.onnx_graph`.
    wrapped_m : float32 [N, H, W]
        Wrapped distances at f1: without noise beside gray images, else as the samples tell them.
    truth_m : float32 [N, H, W] or None
        True distances, infinite for the sky; None of made-up images.
    scored : bool [N, H, W] or None
        Pixels whose wrap counts: within the sensor's range and, of samples, with signal enough.
        None of made-up images.
    """

    source: str
    inputs: Mapping[str, Tensor]
    wrapped_m: Tensor
    truth_m: Tensor | None = None
    scored: Tensor | None = None

    def one_by_one(self) -> list[dict[str, Tensor]]:
        """What the file takes for each frame."""
        # Slices of one, not elements: the file's inputs keep their first axis.
        frames = zip(*(values.split(1) for values in self.inputs.values()), strict=True)
        return [dict(zip(self.inputs, frame, strict=True)) for frame in frames]

    def resized(self, size: tuple[int, int]) -> ExportFrames:
        """Frames with every map at `size` (height, width): the pixels nearest above and left.

        Nothing is interpolated, since a phase between two wraps would be one that nobody measured.
        """
        rows, columns = (
            torch.arange(wanted) * given // wanted
            for wanted, given in zip(size, self.wrapped_m.shape[-2:], strict=True)
        )

        def picked(values: Tensor) -> Tensor:
            return values[..., rows, :][..., columns] if values.ndim > 1 else values

        return replace(
            self,
            inputs={name: picked(values) for name, values in self.inputs.items()},
            wrapped_m=picked(self.wrapped_m),
            truth_m=mapped(picked, self.truth_m),
            scored=mapped(picked, self.scored),
        )


def sample_inputs(gray: Tensor, sensed: Sensed, sensor: SensorDescription) -> dict[str, Tensor]:
    """Inputs of a file of a network that looks at samples, by name.

    Parameters
    ----------
    gray : uint16 [N, H, W]
        12-bit gray images.
    sensed : Sensed
        The samples beside them. An offset or shift that is not known is 0, a noise that is not
        known that in the dark; memory is left out.
    sensor : SensorDescription
    """
    raw, zeros = sensed.require_raw(), torch.zeros_like(sensed.gray)
    shift_m = zeros[:, 0, 0] if sensed.shift_m is None else sensed.shift_m
    return {
        "gray": gray,
        "dcs_lsb": raw.dcs_lsb,
        "saturated": raw.saturated,
        "offset_lsb": zeros if sensed.offset_lsb is None else sensed.offset_lsb,
        "noise_lsb": zeros + sample_noise_lsb(sensed, sensor),
        "shift_m": shift_m.to(torch.float32),
    }


def made_up_frames(
    split: str,
    count: int,
    size: tuple[int, int],
    sensor: SensorDescription,
    shots: Shots | None = None,
) -> ExportFrames:
    """Clouds of light and of distance, always the same ones; others for the split "train".

    Parameters
    ----------
    split : str
        "train", to calibrate with, or another, to check with.
    count : int
    size : tuple of two int
        Height and width, pixels.
    sensor : SensorDescription
    shots : Shots or None
        Samples of each frame, two or four, for a network that looks at them; None for one that
        looks at the gray image alone.
    """
    # Two fixed seeds: what a file is calibrated with must not be what it is checked with.
    generator = torch.Generator().manual_seed(12 if split == "train" else 0)
    light, far = (_clouds(count, size, generator) for _ in range(2))
    gray = (GRAY_FULL_SCALE * torch.sigmoid(2.0 * light - 1.0)).round().to(torch.uint16)
    distance, source = FARTHEST_M * torch.sigmoid(2.0 * far), f"{count} made-up images"
    if shots is None:
        wrapped_m = distance.remainder(unambiguous_range_m(sensor.f1_hz))
        return ExportFrames(source, {"gray": gray, "wrapped_m": wrapped_m}, wrapped_m)
    phase_rad = distance * (TWO_PI / unambiguous_range_m(sensor.f1_hz))
    strength = torch.sigmoid(2.0 * _clouds(count, size, generator) - 2.0)
    sensed = _made_up_samples(gray, phase_rad, strength, shots, generator)
    return ExportFrames(
        f"{source}, {shots:d} samples each",
        sample_inputs(gray, sensed, sensor),
        wrapped_distance_m(sensed, sensor),
    )


def _made_up_samples(
    gray: Tensor, phase_rad: Tensor, strength: Tensor, shots: Shots, generator: torch.Generator
) -> Sensed:
    """Converter words of sines, `strength` 0..1 [N, H, W] strong; light in the gray adds noise.

    Offset, noise, drift and the strongest signal are assumed.
    """
    fractions = gray.to(torch.float32) / GRAY_FULL_SCALE
    offset_lsb = 3.0 * torch.randn(gray.shape, generator=generator)
    noise_lsb = (2.0 + 100.0 * fractions).sqrt()
    sines = correlation_samples(phase_rad, ((1, 1.0),))[:shots].movedim(0, 1)
    noise = torch.randn(sines.shape, generator=generator)
    # The strongest leave the converter's range.
    light = 1.5 * LARGEST_WORD * strength.unsqueeze(1) * sines
    words = (light + noise_lsb.unsqueeze(1) * noise + offset_lsb.unsqueeze(1)).round()
    return Sensed(
        gray=fractions,
        raw=RawFrame(
            dcs_lsb=words.clamp(-LARGEST_WORD, LARGEST_WORD),
            saturated=(words.abs() >= LARGEST_WORD).any(1),
        ),
        offset_lsb=offset_lsb,
        noise_lsb=noise_lsb,
        shift_m=0.02 * torch.randn(len(gray), generator=generator),
    )


def _clouds(count: int, size: tuple[int, int], generator: torch.Generator) -> Tensor:
    """Smooth noise float32 [count, H, W], about normal: half the amplitude at twice the detail."""
    total = torch.zeros(count, *size)
    for octave, cells in enumerate(OCTAVES):
        grid = torch.randn(count, 1, cells, cells, generator=generator)
        smooth = functional.interpolate(grid, size, mode="bilinear", align_corners=False)
        total += smooth[:, 0] / 2**octave
    return total
