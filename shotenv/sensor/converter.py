"""The analogue-to-digital converter: gain, rounding, range."""

from __future__ import annotations

from torch import Tensor

from unwrap.words import mid_scale


def signed_limits_lsb(bits: int) -> tuple[float, float]:
    """Samples of the lowest and the highest word, which report overflow; see `unwrap.words`."""
    middle = mid_scale(bits)
    return 0.0 - middle, full_scale_lsb(bits) - middle


def full_scale_lsb(bits: int) -> int:
    """Highest word of the converter, `2^bits - 1`."""
    return 2**bits - 1


def digitise(analogue_lsb: Tensor, low_lsb: float, high_lsb: float) -> Tensor:
    """Whole words in place: rounded half to even, clipped to the range; the dtype stays."""
    return analogue_lsb.round_().clamp_(low_lsb, high_lsb)
