"""Arrays from files that may be anything: never unpickled, looked at before memory is taken."""

from __future__ import annotations

import os
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import IO

import numpy as np

from unwrap.support.error_text import in_one_line
from unwrap.support.npy_header import read_npy_header
from unwrap.support.whole_files import open_regular

# 256 MiB: some hundred frames of eight samples at 320 x 240; a limit of this project.
MAX_BYTES = 1 << 28
"""Largest file, and largest sum of the arrays in one."""
_BROKEN = (
    *(OSError, ValueError, KeyError, EOFError, NotImplementedError, RuntimeError),
    *(zipfile.BadZipFile, zlib.error),
)
"""What reading damaged files raises: RuntimeError also where an archive is encrypted,
NotImplementedError where its compression is unknown."""


def read_arrays(
    path: Path, alone: str, known: Collection[str] | None = None
) -> dict[str, np.ndarray]:
    """Arrays of an `.npz` file by name, or the array of an `.npy` file under the name `alone`.

    Parameters
    ----------
    known : collection of str, optional
        Names that an `.npz` file may hold; another is refused, since it may be a misspelt one.

    Raises
    ------
    ValueError
        The file is missing, damaged, too large, pickled, of another kind or no regular file; the
        message names it.
    """
    try:
        if path.suffix not in (".npy", ".npz"):
            raise ValueError("expected an .npy or .npz file")
        with open_regular(path, MAX_BYTES) as file:
            if path.suffix == ".npz":
                return _read_npz(file, known)
            return {alone: _read_npy(file, os.fstat(file.fileno()).st_size)}
    except _BROKEN as error:
        raise ValueError(f"{path}: {in_one_line(error)}") from None


def _read_npz(whole: IO[bytes], known: Collection[str] | None) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(whole) as archive:
        members = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
        unknown = [name for name in members if known is not None and name not in known]
        if unknown:
            raise ValueError(f"holds {unknown[0]!r}; expected some of {', '.join(known or ())}")
        # Before anything is unpacked: a few bytes can promise gigabytes of zeros.
        if sum(entry.file_size for entry in archive.infolist()) > MAX_BYTES:
            raise ValueError(f"unpacks to more than {MAX_BYTES >> 20} MiB")
        arrays = {}
        for name, entry in members.items():
            with archive.open(entry) as file:
                arrays[name] = _read_npy(file, entry.file_size)
        return arrays


def _read_npy(file: IO[bytes], size: int) -> np.ndarray:
    """One array; its header must promise exactly the bytes that follow."""
    header = read_npy_header(file)
    if header.dtype.hasobject:
        raise ValueError("holds pickled objects, which are never read; expected plain numbers")
    following = size - file.tell()
    if header.nbytes != following or any(length < 1 for length in header.shape):
        raise ValueError(
            f"its header promises {header.dtype} {header.shape}, {header.nbytes} bytes; "
            f"{following} bytes follow"
        )
    file.seek(0)  # NumPy reads the header once more.
    return np.lib.format.read_array(file, allow_pickle=False)
