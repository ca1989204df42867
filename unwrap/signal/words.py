"""Words of the sensor's analog-to-digital converter to signed samples, and back.

A word is unsigned, with mid-scale 2^(bits - 1) for a sample of zero. Its lowest and highest value
report overflow of the converter: a 12-bit epc660 overflows below 1 or above 4094. That a tap was
full (saturation) is not in the words: it is a flag of its own, one per pixel.
"""

from __future__ import annotations

import torch
from torch import Tensor

from unwrap.signal.frames import RawFrame

ADC_BITS = 12
GRAY_FULL_SCALE = 4095
"""Largest word of the 12-bit gray image."""


def mid_scale(bits: int = ADC_BITS) -> int:
    """Word of a sample of zero."""
    return 2 ** (bits - 1)


def to_words(dcs_lsb: Tensor, bits: int = ADC_BITS) -> Tensor:
    """Words int32, of any shape, of signed samples in LSB; beyond the range they overflow.

    Examples
    --------
    >>> to_words(torch.tensor([0.0, -3.4, 5000.0]))
    tensor([2048, 2045, 4095], dtype=torch.int32)
    """
    return (dcs_lsb + mid_scale(bits)).round().clamp(0, 2**bits - 1).to(torch.int32)


def overflow(words: Tensor, bits: int = ADC_BITS) -> Tensor:
    """Whether each word reports overflow: bool, of the shape of `words`."""
    return (words < 1) | (words > 2**bits - 2)


def from_words(words: Tensor, *, saturated: Tensor | None = None, bits: int = ADC_BITS) -> RawFrame:
    """Samples of recorded words.

    Parameters
    ----------
    words : integer [B, n, H, W]
        n = 2, 4 or 8, in the order of `unwrap.signal.shots`.
    saturated : bool [B, H, W], optional
        The sensor's saturation flags. A pixel with an overflowing word is saturated without it.

    Raises
    ------
    ValueError
        Another dtype, shape or range; the message names it.
    """
    if words.is_floating_point() or words.is_complex() or words.dtype == torch.bool:
        raise ValueError(f"words is {words.dtype}; expected an integer tensor")
    if words.ndim != 4 or words.shape[1] not in (2, 4, 8) or 0 in words.shape:
        raise ValueError(f"words has shape {tuple(words.shape)}; expected [B, 2, 4 or 8, H, W]")
    signed = words.to(torch.int32)  # torch compares no uint16.
    if signed.min() < 0 or signed.max() > 2**bits - 1:
        low, high = int(signed.min()), int(signed.max())
        raise ValueError(f"words holds {low}..{high}; expected 0..{2**bits - 1}")
    flags = overflow(signed, bits).any(dim=1)
    if saturated is not None:
        if saturated.shape != flags.shape or saturated.dtype != torch.bool:
            raise ValueError(
                f"saturated is {saturated.dtype} {tuple(saturated.shape)}; expected bool "
                f"{tuple(flags.shape)}"
            )
        flags = flags | saturated
    return RawFrame((signed - mid_scale(bits)).to(torch.float32), flags)
