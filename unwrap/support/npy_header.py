"""Header of an `.npy` file, read so that a damaged one is a ValueError and nothing else."""

from __future__ import annotations

import math
import tokenize
from dataclasses import dataclass
from typing import IO

import numpy as np
from numpy.lib import format as npy

from unwrap.support.error_text import in_one_line

# NumPy parses the header as Python source, so that damage shows in whatever way source can be
# wrong: a bracket that is never closed is a TokenError, many of them a RecursionError.
_DAMAGED = (
    *(EOFError, KeyError, MemoryError, OverflowError, RecursionError, SyntaxError, TypeError),
    tokenize.TokenError,
)
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


@dataclass(frozen=True)
class NpyHeader:
    """What the array in an `.npy` file is said to be.

    Attributes
    ----------
    shape : tuple of int
        May be absurd; compare `nbytes` with what follows before taking memory.
    fortran_order : bool
    dtype : numpy.dtype
    """

    shape: tuple[int, ...]
    fortran_order: bool
    dtype: np.dtype

    @property
    def nbytes(self) -> int:
        """Bytes that should follow the header; exact however many they are."""
        return math.prod(self.shape) * self.dtype.itemsize


def read_npy_header(file: IO[bytes]) -> NpyHeader:
    """Header of the `.npy` file that begins at the position of `file`, which then stands behind it.

    Raises
    ------
    ValueError
        No `.npy` file, another version than (1, 0) and (2, 0), or a damaged header.
    """
    version = npy.read_magic(file)
    if version not in _HEADERS:
        raise ValueError(f"npy version {version}; expected (1, 0) or (2, 0)")
    try:
        return NpyHeader(*_HEADERS[version](file))
    except _DAMAGED as error:
        raise ValueError(f"malformed npy header: {in_one_line(error)}") from None
