"""Frames that an exported network is checked and calibrated with: of a bank, or made up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from shotenv.bank import Bank, BankError, open_bank
from shotenv.config import SensorConfig
from shotenv.problem import check_fits
from unwrap.acquisition import SAMPLES_PER_FREQUENCY
from unwrap.data import GRAY_FULL_SCALE
from unwrap.phase import decode, distance_m, unambiguous_range_m

DEFAULT_BANK = "starter"
MADE_UP = "none"
OCTAVES = (4, 8, 16, 32)
"""Details of made-up images: grids of so many cells down and across."""


@dataclass(frozen=True)
class ExportFrames:
    """Inputs of an exported network.

    Attributes
    ----------
    source : str
        Where they come from, in words.
    gray : uint16 [N, H, W]
        12-bit gray images.
    wrapped_m : float32 [N, H, W]
        Wrapped distances at f1, without noise.
    truth_m : float32 [N, H, W] or None
        True distances, infinite for the sky; None of made-up images.
    """

    source: str
    gray: Tensor
    wrapped_m: Tensor
    truth_m: Tensor | None

    def inputs(self) -> list[dict[str, np.ndarray]]:
        """What a session takes for each frame."""
        pairs = zip(self.gray.split(1), self.wrapped_m.split(1), strict=True)
        return [{"gray": gray.numpy(), "wrapped_m": wrapped.numpy()} for gray, wrapped in pairs]


def choose_bank(name: str | None, sensor: SensorConfig) -> Bank | None:
    """Bank by name or path; None for "none", and for no name where the starter does not stand.

    Raises
    ------
    ValueError
        A named bank is missing, or was rendered for another sensor.
    """
    if name == MADE_UP:
        return None
    try:
        bank = open_bank(name or DEFAULT_BANK, render=False)
    except BankError:
        if name is None:
            return None
        raise
    check_fits(bank, sensor)
    return bank


def export_frames(
    bank: Bank | None, split: str, count: int, size: tuple[int, int], f1_hz: float
) -> ExportFrames:
    """`count` frames of a split, evenly spread; images of another size than `size` are scaled."""
    if bank is None:
        return _made_up(split, count, size, f1_hz)
    frames = bank.frames(split)
    frames = frames[torch.linspace(0, len(frames) - 1, min(count, len(frames))).long()]
    exposure = bank.exposure(frames)
    first = decode(exposure.correlation[:, :SAMPLES_PER_FREQUENCY])
    rows, columns = (
        torch.arange(wanted) * given // wanted
        for wanted, given in zip(size, (bank.height, bank.width), strict=True)
    )
    maps = (bank.gray(frames), distance_m(first.phase_rad, f1_hz), exposure.distance_m)
    gray, wrapped_m, truth_m = (values[:, rows][:, :, columns] for values in maps)
    source = f"{len(frames)} {split} frames of bank {bank.manifest.name}"
    return ExportFrames(source, gray, wrapped_m, truth_m)


def _made_up(split: str, count: int, size: tuple[int, int], f1_hz: float) -> ExportFrames:
    """Clouds of light and of distance, other ones for each split; always the same."""
    # 12 decorrelates the two splits that are ever asked for.
    generator = torch.Generator().manual_seed(12 if split == "train" else 0)
    light, far = (_clouds(count, size, generator) for _ in range(2))
    gray = (GRAY_FULL_SCALE * torch.sigmoid(2.0 * light - 1.0)).round().to(torch.uint16)
    distance = 30.0 * torch.sigmoid(2.0 * far)
    wrapped_m = distance.remainder(unambiguous_range_m(f1_hz))
    return ExportFrames(f"{count} made-up images", gray, wrapped_m, None)


def _clouds(count: int, size: tuple[int, int], generator: torch.Generator) -> Tensor:
    """Smooth noise float32 [count, H, W], about normal: half the amplitude at twice the detail."""
    total = torch.zeros(count, *size)
    for octave, cells in enumerate(OCTAVES):
        grid = torch.randn(count, 1, cells, cells, generator=generator)
        smooth = functional.interpolate(grid, size, mode="bilinear", align_corners=False)
        total += smooth[:, 0] / 2**octave
    return total
