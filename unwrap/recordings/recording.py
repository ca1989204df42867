"""Recordings of a camera: samples and gray images from files to frames that can be unwrapped.

A recording holds `dcs` [n, H, W] or, of several frames, [F, n, H, W], n = 2, 4 or 8, in the order
of `unwrap.signal.shots`. Unsigned integers are words of the converter, see `unwrap.signal.words`;
signed integers and floats are samples in LSB.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from unwrap.signal import ADC_BITS, RawFrame, from_words, mid_scale
from unwrap.support import read_arrays

ARRAYS = ("dcs", "gray", "offset_lsb", "saturated")
"""What a recording may hold."""


class NoUsablePixelError(ValueError):
    """A frame without a single pixel that depth can be told of."""


@dataclass(frozen=True)
class Recording:
    """Frames as they were recorded.

    Attributes
    ----------
    raw : RawFrame
        Samples, batch F.
    gray : float32 [F, H, W] or None
        Passive gray images in [0, 1].
    offset_lsb : float32 [H, W] or None
        Stored dark-offset map.
    names : tuple of str
        Of the frames; a single "" where there is one frame and no axis of frames.
    made : bool
        Four samples were made of less, so that opposite ones agree and tell no noise.
    """

    raw: RawFrame
    gray: Tensor | None
    offset_lsb: Tensor | None
    names: tuple[str, ...]
    made: bool = False

    def frame(self, number: int) -> Recording:
        """One frame alone."""
        one = slice(number, number + 1)
        raw = RawFrame(self.raw.dcs_lsb[one], self.raw.saturated[one])
        gray = None if self.gray is None else self.gray[one]
        return Recording(raw, gray, self.offset_lsb, self.names[one], self.made)


def read_recording(path: Path, *, bits: int = ADC_BITS) -> Recording:
    """Recording of an `.npy` file, which holds `dcs`, or an `.npz` file with some of `ARRAYS`.

    Parameters
    ----------
    bits : int
        Of the converter.

    Raises
    ------
    ValueError
        What `read_arrays` and `recording_of` refuse; the message names the file.
    NoUsablePixelError
        A frame whose pixels are all saturated.
    """
    return recording_of(read_arrays(path, "dcs", ARRAYS), str(path), bits=bits)


def recording_of(
    arrays: Mapping[str, np.ndarray],
    where: str,
    *,
    bits: int = ADC_BITS,
    names: tuple[str, ...] | None = None,
) -> Recording:
    """Recording of arrays named as in `ARRAYS`; messages tell `where` they come from.

    Parameters
    ----------
    arrays : mapping of arrays
        `dcs` as above; `gray` [H, W] or [F, H, W], uint16 words or float in [0, 1]; `offset_lsb`
        [H, W] in LSB; `saturated` bool [H, W] or [F, H, W].
    names : tuple of str, optional
        Of the frames; their numbers without.

    Raises
    ------
    ValueError
        `dcs` is missing, or an array has another shape or dtype, or holds NaN or values out of
        range.
    NoUsablePixelError
        A frame whose pixels are all saturated.
    """
    if "dcs" not in arrays:
        raise ValueError(f"{where}: dcs is missing; expected samples [n, H, W] or [F, n, H, W]")
    dcs = arrays["dcs"]
    if dcs.ndim not in (3, 4) or dcs.shape[-3] not in (2, 4, 8) or 0 in dcs.shape:
        raise ValueError(
            f"{where}: dcs has shape {dcs.shape}; expected [n, H, W] or [F, n, H, W] with n = 2, "
            "4 or 8"
        )
    batch = dcs[None] if dcs.ndim == 3 else dcs
    if names is None:
        names = ("",) if dcs.ndim == 3 else tuple(f"{number:05d}" for number in range(len(dcs)))
    raw = _raw_frame(batch, where, bits)
    if "saturated" in arrays:
        flags = arrays["saturated"]
        if flags.dtype != np.bool_:
            raise ValueError(f"{where}: saturated is {flags.dtype}; expected bool")
        flags = _batched(flags, raw.saturated.shape, "saturated", where)
        # Joined to what the samples show: a camera flags taps that were full before conversion.
        raw = replace(raw, saturated=raw.saturated | torch.from_numpy(flags))
    _require_usable(raw, names, where)
    recording = Recording(raw, None, None, names)
    if "gray" in arrays:
        recording = with_gray(recording, arrays["gray"], where, bits=bits)
    if "offset_lsb" in arrays:
        recording = with_offset(recording, arrays["offset_lsb"], where)
    return recording


def with_gray(
    recording: Recording, gray: np.ndarray, where: str, *, bits: int = ADC_BITS
) -> Recording:
    """`recording` with other gray images, checked as by `recording_of`."""
    expected = recording.raw.saturated.shape
    images = _batched(gray, expected, "gray", where)
    highest = 1.0
    if images.dtype == np.uint16:
        highest = 2.0**bits - 1
    elif images.dtype.kind != "f":
        raise ValueError(f"{where}: gray is {images.dtype}; expected uint16 words or floats")
    # Written so that NaN, which compares false, is refused as well.
    if not (images.min() >= 0 and images.max() <= highest):
        raise ValueError(f"{where}: gray holds NaN or values outside 0..{highest:g}")
    return replace(recording, gray=_tensor(images) / highest)


def with_offset(recording: Recording, offset_lsb: np.ndarray, where: str) -> Recording:
    """`recording` with another dark-offset map, checked as by `recording_of`."""
    expected = tuple(recording.raw.saturated.shape[-2:])
    if offset_lsb.shape != expected or offset_lsb.dtype.kind not in "if":
        raise ValueError(
            f"{where}: offset_lsb is {offset_lsb.dtype} {offset_lsb.shape}; expected floats or "
            f"signed integers {expected}"
        )
    _require_finite(offset_lsb, "offset_lsb", where)
    return replace(recording, offset_lsb=_tensor(offset_lsb))


def _raw_frame(dcs: np.ndarray, where: str, bits: int) -> RawFrame:
    """Samples, flagged where they report overflow of the converter."""
    kind, low, high = dcs.dtype.kind, -mid_scale(bits), mid_scale(bits) - 1
    # Bytes are refused: they would be words cut short, whose wraps look like good samples.
    if kind == "u" and dcs.dtype.itemsize > 1:
        # high - low is the largest word, 2^bits - 1.
        if dcs.max() > high - low:
            raise ValueError(f"{where}: dcs holds words up to {dcs.max()}; expected {bits} bits")
        return from_words(torch.from_numpy(dcs.astype(np.int32)), bits=bits)
    if kind not in "if":
        raise ValueError(
            f"{where}: dcs is {dcs.dtype}; expected words (uint16) or samples in LSB (signed "
            "integers or floats)"
        )
    _require_finite(dcs, "dcs", where)
    if dcs.min() < low or dcs.max() > high:
        raise ValueError(
            f"{where}: dcs is {dcs.dtype} and holds {dcs.min():g}..{dcs.max():g}; expected samples "
            f"within {low}..{high} LSB, or words as unsigned integers"
        )
    samples = _tensor(dcs)
    # The ends of the range are the words by which the converter reports overflow.
    return RawFrame(samples, ((samples <= low) | (samples >= high)).any(1))


def _batched(maps: np.ndarray, expected: torch.Size, name: str, where: str) -> np.ndarray:
    """[F, H, W] as expected; the axis of frames may be missing from one."""
    batch = maps[None] if maps.ndim == 2 and expected[0] == 1 else maps
    if batch.shape != tuple(expected):
        raise ValueError(
            f"{where}: {name} has shape {maps.shape}; expected {tuple(expected)}, as dcs has"
        )
    return batch


def _require_finite(values: np.ndarray, name: str, where: str) -> None:
    finite = np.isfinite(values)
    if not finite.all():
        place = np.argwhere(~finite)[0].tolist()
        raise ValueError(f"{where}: {name} holds NaN or infinity at {place}")


def _require_usable(raw: RawFrame, names: tuple[str, ...], where: str) -> None:
    for name, saturated in zip(names, raw.saturated, strict=True):
        if bool(saturated.all()):
            raise NoUsablePixelError(
                f"{where}: no usable pixel{f' in frame {name}' if name else ''}: all "
                f"{saturated.numel()} are saturated"
            )


def _tensor(values: np.ndarray) -> Tensor:
    """A copy in float32, whatever the byte order."""
    return torch.from_numpy(values.astype(np.float32))
