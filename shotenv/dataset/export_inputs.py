"""Frames of a bank as an exported network takes them."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.bank import Bank, BankError, check_fits, open_bank, require_full
from shotenv.config import EnvConfig, SensorConfig
from shotenv.dataset.sensed_frames import SensedFrames
from unwrap.export import ExportFrames, sample_inputs
from unwrap.signal import (
    SAMPLES_PER_FREQUENCY,
    Shots,
    decode,
    distance_m,
    wrapped_distance_m,
)
from unwrap.training import JUDGED_DRAW

DEFAULT_BANK = "starter"
NO_BANK = "none"
"""What a bank is called where there shall be none."""


def choose_check_bank(name: str | None, sensor: SensorConfig) -> Bank | None:
    """Bank that an export is checked with, by name or path.

    Returns
    -------
    Bank or None
        None for the name "none", and for no name where the starter bank does not stand: nothing is
        rendered for a check.

    Raises
    ------
    ValueError
        A named bank is missing, thinned, or was rendered for another sensor.
    """
    if name == NO_BANK:
        return None
    try:
        bank = open_bank(name or DEFAULT_BANK, render=False)
    except BankError:
        if name is None:
            return None
        raise
    require_full(bank, "the check of an export")
    check_fits(bank, sensor)
    return bank


def bank_export_frames(
    bank: Bank,
    split: str,
    count: int,
    size: tuple[int, int],
    config: EnvConfig,
    shots: Shots | None = None,
) -> ExportFrames:
    """`count` frames of a split, evenly spread; images of another size than `size` are resized.

    Parameters
    ----------
    bank : Bank
    split : str
    count : int
        All frames of a split that has fewer.
    size : tuple of two int
        Height and width, pixels.
    config : EnvConfig
        Of it the sensor, the laser and the frame rate.
    shots : Shots or None
        Samples of each frame, two or four, for a network that looks at them; None for one that
        looks at the gray image alone.
    """
    frames = bank.frames(split)
    # Both ends and evenly between: neighbours in a clip look alike, and would check little.
    frames = frames[torch.linspace(0, len(frames) - 1, min(count, len(frames))).long()]
    source = f"{len(frames)} {split} frames of bank {bank.name}"
    if shots is None:
        found = _gray_frames(bank, frames, config.sensor, source)
    else:
        found = _sample_frames(bank, frames, config, shots, source)
    return found.resized(size)


def _gray_frames(bank: Bank, frames: Tensor, sensor: SensorConfig, source: str) -> ExportFrames:
    """Gray images beside wrapped maps without noise, whose wraps are the network's work alone."""
    exposure = bank.exposure(frames)
    first = decode(exposure.correlation[:, :SAMPLES_PER_FREQUENCY])
    wrapped_m = distance_m(first.phase_rad, sensor.f1_hz)
    return ExportFrames(
        source=source,
        inputs={"gray": bank.gray(frames), "wrapped_m": wrapped_m},
        wrapped_m=wrapped_m,
        truth_m=exposure.distance_m,
        scored=exposure.distance_m <= sensor.max_range_m,
    )


def _sample_frames(
    bank: Bank, frames: Tensor, config: EnvConfig, shots: Shots, source: str
) -> ExportFrames:
    """Gray images beside noisy samples, as the sensor delivers them."""
    sensed_frames = SensedFrames(bank, frames, config, range_m=config.sensor.max_range_m)
    numbers = range(len(frames))
    sensed, _ = sensed_frames.batch(numbers, draw=JUDGED_DRAW, shots=shots)
    return ExportFrames(
        source=f"{source}, {shots:d} samples each",
        inputs=sample_inputs(bank.gray(frames), sensed, sensed_frames.sensor),
        wrapped_m=wrapped_distance_m(sensed, sensed_frames.sensor),
        truth_m=bank.exposure(frames).distance_m,
        scored=sensed_frames.scored(numbers, draw=JUDGED_DRAW),
    )
