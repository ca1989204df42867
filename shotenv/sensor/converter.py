"""The range of the analogue-to-digital converter."""

from __future__ import annotations

from unwrap.signal import mid_scale


def signed_limits_lsb(bits: int) -> tuple[float, float]:
    """Samples of the lowest and the highest word, which report overflow; see `unwrap.signal`."""
    middle = mid_scale(bits)
    return 0.0 - middle, full_scale_lsb(bits) - middle


def full_scale_lsb(bits: int) -> int:
    """Highest word of the converter, `2^bits - 1`."""
    return 2**bits - 1
