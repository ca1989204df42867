"""Frames as a public call hands them in: refused by name where they cannot be unwrapped."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.shots import Shots
from unwrap.support import require_floats, require_not_negative


def check_frames(
    raw: RawFrame,
    predicted_m: Tensor | None,
    sensor: SensorDescription,
    offset_lsb: Tensor | None,
    noise_lsb: Tensor | float | None,
    shift_m: Tensor | None,
) -> None:
    """Refuse samples, and what is told of them, that are of another kind or size, by name.

    Raises
    ------
    TypeError, ValueError
        As `unwrap.correct` does, whose arguments these are.
    """
    if not isinstance(raw, RawFrame):
        raise TypeError(f"raw is {type(raw).__name__}; expected a RawFrame")
    if not isinstance(sensor, SensorDescription):
        raise TypeError(f"sensor is {type(sensor).__name__}; expected a SensorDescription")
    require_floats(**{"raw.dcs_lsb": raw.dcs_lsb})
    if raw.dcs_lsb.ndim != 4 or raw.dcs_lsb.shape[1] not in tuple(Shots):
        shape = tuple(raw.dcs_lsb.shape)
        raise ValueError(f"raw.dcs_lsb has shape {shape}; expected [B, 2, 4 or 8, H, W]")
    if not isinstance(raw.saturated, torch.Tensor) or raw.saturated.dtype != torch.bool:
        raise ValueError("raw.saturated is no tensor of bool")
    _check_fits("raw.saturated", raw.saturated, raw, ("BHW",))
    for name, value, kinds in (
        ("predicted_m", predicted_m, ("BHW",)),
        ("offset_lsb", offset_lsb, ("BHW", "HW")),
        ("shift_m", shift_m, ("B",)),
    ):
        if value is not None:
            require_floats(**{name: value})
            _check_fits(name, value, raw, kinds)
    if noise_lsb is not None:
        require_not_negative(noise_lsb=noise_lsb)
        _check_fits("noise_lsb", noise_lsb, raw, ("BHW", "HW"))


def _check_fits(name: str, value: Tensor | float, raw: RawFrame, kinds: Sequence[str]) -> None:
    """Raise ValueError where a tensor has another shape than the samples give each of `kinds`."""
    frames, _, height, width = raw.dcs_lsb.shape
    sizes = {"B": frames, "H": height, "W": width}
    shapes = [tuple(sizes[axis] for axis in kind) for kind in kinds]
    if not isinstance(value, torch.Tensor) or any(_serves(value, shape) for shape in shapes):
        return
    expected = " or ".join(map(str, shapes))
    raise ValueError(f"{name} has shape {tuple(value.shape)}; expected {expected}")


def _serves(value: Tensor, shape: tuple[int, ...]) -> bool:
    """Whether a tensor is of this shape, or common to some of its axes."""
    own = tuple(value.shape)
    pairs = zip(reversed(own), reversed(shape), strict=False)
    return len(own) <= len(shape) and all(one in (1, whole) for one, whole in pairs)
