"""Arrays from files that may be anything: never unpickled, looked at before memory is taken."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import IO

import numpy as np

from unwrap.support import in_one_line, read_npy_header

# 256 MiB: some hundred frames of eight samples at 320 x 240; a limit of this project.
MAX_BYTES = 1 << 28
"""Largest file, and largest sum of the arrays in one."""
_BROKEN = (
    *(OSError, ValueError, KeyError, EOFError, NotImplementedError, RuntimeError),
    *(zipfile.BadZipFile, zlib.error),
)
"""What reading damaged files raises: RuntimeError also where an archive is encrypted,
NotImplementedError where its compression is unknown."""


def read_arrays(path: Path, alone: str, known: Collection[str]) -> dict[str, np.ndarray]:
    """Arrays of an `.npz` file by name, or the array of an `.npy` file under the name `alone`.

    Parameters
    ----------
    known : collection of str
        Names that an `.npz` file may hold; another is refused, since it may be a misspelt one.

    Raises
    ------
    ValueError
        The file is missing, damaged, too large, pickled or of another kind; the message names it.
    """
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise ValueError(f"larger than {MAX_BYTES >> 20} MiB")
        if path.suffix == ".npz":
            return _read_npz(path, known)
        if path.suffix != ".npy":
            raise ValueError("expected an .npy or .npz file")
        with path.open("rb") as file:
            return {alone: _read_npy(file, size)}
    except _BROKEN as error:
        raise ValueError(f"{path}: {in_one_line(error)}") from None


def _read_npz(path: Path, known: Collection[str]) -> dict[str, np.ndarray]:
    with zipfile.ZipFile(path) as archive:
        members = {entry.filename.removesuffix(".npy"): entry for entry in archive.infolist()}
        unknown = [name for name in members if name not in known]
        if unknown:
            raise ValueError(f"holds {unknown[0]!r}; expected some of {', '.join(known)}")
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
