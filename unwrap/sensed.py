"""Frames as networks see them: what the sensor delivers, and the truth to learn from."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import torch
from torch import Tensor

from unwrap.correction import Merge, SensorDescription, correct
from unwrap.frames import DepthFrame, RawFrame

Value = TypeVar("Value")


@dataclass(frozen=True)
class Memory:
    """Depth of the previous frame, moved to where its points are seen now; batch B.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Metres; 0 where nothing is remembered.
    known : float32 [B, H, W]
        1 where something is remembered, else 0.
    """

    distance_m: Tensor
    known: Tensor


@dataclass(frozen=True)
class Sensed:
    """What a sensor delivers of B frames.

    Attributes
    ----------
    gray : float32 [B, H, W]
        Passive gray image in [0, 1].
    raw : RawFrame or None
        2, 4 or 8 samples; None where no sample was taken.
    offset_lsb : float32 [B, H, W] or None
        Stored dark-offset map.
    noise_lsb : float32 [B, H, W] or None
        Standard deviation of one sample, estimated by the sensor.
    shift_m : float64 [B] or None
        See `unwrap.correction.decode_at`.
    memory : Memory or None
        Of the frame before.
    """

    gray: Tensor
    raw: RawFrame | None = None
    offset_lsb: Tensor | None = None
    noise_lsb: Tensor | None = None
    shift_m: Tensor | None = None
    memory: Memory | None = None

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.gray)


@dataclass(frozen=True)
class Truth:
    """What a network is to predict of B frames.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Radial distance, metres, clamped at the network's range (the sky, too); 0 where unknown.
    known : bool [B, H, W]
        Everywhere for rendered truth; where the frequencies agree for a sensor's own.
    """

    distance_m: Tensor
    known: Tensor


def moved(value: Value, device: torch.device) -> Value:
    """`value`, of tensors as in `mapped`, on `device`; from pinned memory without waiting."""
    return mapped(lambda tensor: tensor.to(device, non_blocking=True), value)


def mapped(function: Callable[[Tensor], Tensor], value: Value) -> Value:
    """`value`, a tensor or a dataclass of such values, with `function` applied to every tensor."""
    if isinstance(value, Tensor):
        return function(value)  # type: ignore[return-value]
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    parts: dict[str, Any] = {
        field.name: mapped(function, getattr(value, field.name))
        for field in dataclasses.fields(value)
    }
    return type(value)(**parts)  # type: ignore[return-value]


def unwrapped(
    sensed: Sensed,
    predicted_m: Tensor | None,
    sensor: SensorDescription,
    *,
    merge: Merge = "nearest",
) -> DepthFrame:
    """`unwrap.correction.correct` of frames with samples and a prediction [B, H, W] for them.

    Raises
    ------
    ValueError
        No samples, or what `correct` refuses.
    """
    if sensed.raw is None:
        raise ValueError("raw is None; expected samples")
    return correct(
        sensed.raw,
        predicted_m,
        sensor,
        merge=merge,
        offset_lsb=sensed.offset_lsb,
        noise_lsb=sensed.noise_lsb,
        shift_m=sensed.shift_m,
    )
