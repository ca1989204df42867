"""What the classical methods share: wrap candidates, and depth with its confidence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from unwrap.signal import (
    DepthFrame,
    PhaseFrame,
    RawFrame,
    SensorDescription,
    distance_m,
    is_strong,
    unambiguous_range_m,
)


@dataclass(frozen=True)
class DepthWithConfidence:
    """Depth of a frame and how sure the method is of it; batch B.

    Attributes
    ----------
    depth : DepthFrame
        Where it is not valid, `distance_m` is still the method's best guess.
    confidence : float32 [B, H, W]
        0..1; what it means is the method's own.
    """

    depth: DepthFrame
    confidence: Tensor


def candidates_m(phase_rad: Tensor, frequency_hz: float, max_range_m: float) -> Tensor:
    """Wrap candidates [B, N, H, W] of a phase [B, H, W]: distances with that phase, nearest first.

    N is the number of wraps that begin within the range, so that the last candidate may lie beyond.

    Examples
    --------
    >>> candidates_m(torch.zeros(1, 1, 1), 24e6, 25.0).flatten()
    tensor([ 0.0000,  6.2457, 12.4914, 18.7370, 24.9827])
    """
    unambiguous_m = unambiguous_range_m(frequency_hz)
    # Whole wraps rather than the candidates within the range, whose number differs by pixel.
    wraps = torch.arange(math.floor(max_range_m / unambiguous_m) + 1, device=phase_rad.device)
    return distance_m(phase_rad, frequency_hz).unsqueeze(1) + wraps.view(-1, 1, 1) * unambiguous_m


def chosen(values: Tensor, index: Tensor) -> Tensor:
    """Of values [B, N, H, W] of the candidates, those of candidate `index` [B, H, W]."""
    return values.gather(1, index.unsqueeze(1)).squeeze(1)


def depth_with_confidence(
    depth_m: Tensor,
    confidence: Tensor,
    first: PhaseFrame,
    raw: RawFrame,
    sensor: SensorDescription,
    *,
    noise_lsb: Tensor | float,
    min_confidence: float,
) -> DepthWithConfidence:
    """Depth, valid where it is strong, not saturated, and its confidence is high enough."""
    valid = is_strong(first.amplitude, noise_lsb, sensor) & ~raw.saturated
    valid &= confidence >= min_confidence
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    frame = DepthFrame(
        depth_m, valid, first.phase_rad, first.amplitude, first.residual, unambiguous_m
    )
    return DepthWithConfidence(frame, confidence)


def require_shots(raw: RawFrame, allowed: tuple[int, ...]) -> None:
    """Raise ValueError unless `raw` has one of the allowed numbers of samples."""
    if int(raw.shots) not in allowed:
        expected = " or ".join(map(str, allowed))
        raise ValueError(f"raw has {int(raw.shots)} samples; expected {expected}")
