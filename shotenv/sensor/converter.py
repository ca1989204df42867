"""The analogue-to-digital converter: gain, rounding, range."""

from __future__ import annotations

from torch import Tensor


def signed_limits_lsb(bits: int) -> tuple[float, float]:
    """Lowest and highest sample of a converter whose words 1..2^bits - 2 are not overflow.

    The signed sample is the word minus mid-scale `2^(bits - 1)`; word 0 and the last one report
    overflow (epc660: below 1 or above 4094).
    """
    middle = 2 ** (bits - 1)
    return 1.0 - middle, middle - 2.0


def full_scale_lsb(bits: int) -> int:
    """Highest word of the converter, `2^bits - 1`."""
    return 2**bits - 1


def digitise(analogue_lsb: Tensor, low_lsb: float, high_lsb: float) -> Tensor:
    """Whole words in place: rounded half to even, clipped to the range; the dtype stays."""
    return analogue_lsb.round_().clamp_(low_lsb, high_lsb)
