"""Arrays of a clip that take less room: light in float16, each frame compressed on its own.

A file is a series of Zstandard frames, so that any tool for it reads it: first one to be skipped,
with the index, then one for each frame of the clip.

    magic      uint32    0x184D2A50, "to be skipped"
    length     uint32    of the index, bytes
    mark       8 bytes   "SHOTPACK"
    frames     uint32
    exponent   int32     what is stored was multiplied by 2^exponent
    ends       uint64 [frames]   where each frame ends, bytes behind the index

In a frame the bytes of equal worth lie together, the lowest first: they compress better. Truth and
gray images are stored as they are; light is rounded to eleven significant bits.
"""

from __future__ import annotations

import mmap
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import IO, Any

import numpy as np
import torch
from torch import Tensor

from shotenv.bank.files.layout import ARRAYS, BankError
from unwrap.support import in_one_line, open_regular

LIGHT = ("correlation", "active", "ambient")
"""Arrays that are rounded."""
LEVEL = 3
"""Of compression: 1 is 2 % larger, 9 takes four times as long for 2 % less."""
LARGEST = 2.0**15
"""What the largest value of a clip's array is stored as, or less by a factor below two."""
SKIPPED, MARK = 0x184D2A50, b"SHOTPACK"
HEAD = struct.Struct("<II8sIi")
FARTHEST_EXPONENT = 120
"""Scales beyond, of light that no renderer gives, would overflow float32."""
MOST_FRAMES = 4096
"""Of a clip, as in a configuration."""


@dataclass(frozen=True)
class PackedHeader:
    """What the index of a file says.

    Attributes
    ----------
    exponent : int
        Values were multiplied by 2 to the power of it.
    bounds : tuple of int
        Where each frame begins in the file, and the last one's end.
    """

    exponent: int
    bounds: tuple[int, ...]

    @property
    def frames(self) -> int:
        """Frames of the clip."""
        return len(self.bounds) - 1


def stored_type(name: str) -> np.dtype:
    """Type of the numbers in the file of array `name`."""
    return np.dtype("<f2" if name in LIGHT else ARRAYS[name].dtype)


def packed(name: str, array: np.ndarray) -> Iterator[bytes]:
    """The parts of the file of `array`, which is of that name and [frames, channels..., H, W].

    Raises
    ------
    BankError
        Light is infinite, or the package for Zstandard is missing.
    """
    exponent = _exponent(name, array) if name in LIGHT else 0
    frames = []
    for frame in array:
        values = np.ldexp(frame, exponent) if name in LIGHT else frame
        planes = _planes(np.ascontiguousarray(values, stored_type(name)))
        frames.append(_zstd().compress(planes, LEVEL))
    ends = np.cumsum([len(frame) for frame in frames]).astype("<u8").tobytes()
    length = HEAD.size - 8 + len(ends)
    yield HEAD.pack(SKIPPED, length, MARK, len(frames), exponent) + ends
    yield from frames


def _exponent(name: str, array: np.ndarray) -> int:
    """Power of two by which the largest value comes just below `LARGEST`."""
    largest = float(np.abs(array).max(initial=0.0))
    if not np.isfinite(largest):
        raise BankError(f"{name} holds infinite light; expected finite numbers")
    # frexp: largest = m 2^e with m below one.
    exponent = int(np.log2(LARGEST)) - int(np.frexp(largest)[1]) if largest else 0
    return max(-FARTHEST_EXPONENT, min(exponent, FARTHEST_EXPONENT))


def read_packed_header(file: IO[bytes], length: int) -> PackedHeader:
    """Index of the file of `length` bytes, which stands at its begin.

    Raises
    ------
    ValueError
        It is no such file, cut off, or says what cannot be.
    """
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        raise ValueError(f"{length} bytes; expected a header")
    magic, size, mark, frames, exponent = HEAD.unpack(head)
    if (magic, mark) != (SKIPPED, MARK):
        raise ValueError("no packed array")
    if not 1 <= frames <= MOST_FRAMES or size != HEAD.size - 8 + 8 * frames:
        raise ValueError(f"an index of {frames} frames in {size} bytes")
    if abs(exponent) > FARTHEST_EXPONENT:
        raise ValueError(f"exponent {exponent}; expected at most {FARTHEST_EXPONENT}")
    ends = np.frombuffer(file.read(8 * frames).ljust(8 * frames, b"\0"), "<u8")
    begin = HEAD.size + 8 * frames
    # As Python's numbers, which do not overflow.
    bounds = (begin, *(begin + end for end in ends.tolist()))
    if any(end <= start for start, end in pairwise(bounds)):
        raise ValueError("frames that end before they begin")
    if bounds[-1] != length:
        raise ValueError(f"{length} bytes; expected {bounds[-1]}")
    return PackedHeader(exponent, bounds)


class PackedArray:
    """An array of a clip, of which a frame is decompressed when it is asked for.

    Parameters
    ----------
    path
        Its file.
    name
        Of the array.
    shape
        Of one frame, [channels..., H, W].

    Raises
    ------
    BankError
        The file is missing or damaged.
    """

    def __init__(self, path: Path, name: str, shape: tuple[int, ...]) -> None:
        self._path, self._shape, self._stored = path, shape, stored_type(name)
        self._is_light = name in LIGHT
        try:
            with open_regular(path) as file:
                self._header = read_packed_header(file, path.stat().st_size)
                self._content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise BankError(f"{path} is missing or damaged ({in_one_line(error)})") from None

    def frame(self, number: int) -> Tensor:
        """Frame `number`, [channels..., H, W].

        Raises
        ------
        BankError
            It does not decompress to a frame of this shape.
        """
        start, end = self._header.bounds[number : number + 2]
        expected = int(np.prod(self._shape)) * self._stored.itemsize
        planes = _decompressed(self._content[start:end], expected)
        if planes is None:
            raise BankError(
                f"frame {number} of {self._path} is damaged; `shotenv bank verify` tells the cure"
            )
        values = torch.from_numpy(_joined(planes, self._stored).reshape(self._shape))
        if not self._is_light:
            return values
        # By torch, which converts six times as fast as NumPy; by a power of two, rounding nothing.
        return values.to(torch.float32).mul_(2.0**-self._header.exponent)


def _decompressed(content: bytes, expected: int) -> bytes | None:
    """The `expected` bytes that `content` is of, or None; never more memory than for these."""
    zstd = _zstd()
    # A frame may ask for a window of any size to be decompressed in.
    window = max(10, min(int(expected - 1).bit_length() + 1, 27))
    limits = {zstd.DecompressionParameter.window_log_max: window}
    reader = zstd.ZstdDecompressor(options=limits)
    try:
        found = reader.decompress(content, expected)
        # At the limit it may not yet have looked at the frame's end.
        whole = reader.eof or (not reader.needs_input and not reader.decompress(b"", 1))
    except zstd.ZstdError:
        return None
    good = whole and reader.eof and len(found) == expected and not reader.unused_data
    return found if good else None


def _planes(values: np.ndarray) -> bytes:
    """Bytes of equal worth together, the lowest first."""
    size = values.dtype.itemsize
    return np.ascontiguousarray(values.view(np.uint8).reshape(-1, size).T).tobytes()


def _joined(planes: bytes, dtype: np.dtype) -> np.ndarray:
    """What `_planes` was made of."""
    size = dtype.itemsize
    parts = np.frombuffer(planes, np.uint8).reshape(size, -1)
    # By shifts rather than by a transposed copy, which is three times as slow.
    values = parts[-1].astype(f"<u{size}")
    for part in parts[-2::-1]:
        values <<= 8
        values |= part
    return values.view(dtype)


@cache
def _zstd() -> Any:
    """Python's own module for Zstandard, or its copy for Pythons before 3.14.

    Raises
    ------
    BankError
        It is not installed.
    """
    try:
        if sys.version_info >= (3, 14):
            from compression import zstd
        else:
            from backports import zstd
    except ImportError:
        raise BankError(
            "banks with `storage: float16` need the package backports.zstd; "
            "`pip install 'shotenv[scale]'` brings it"
        ) from None
    return zstd
