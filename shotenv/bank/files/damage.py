"""Files and folders that are not what a bank consists of: refused by name, with the cure."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from shotenv.bank.files.folders import fetched_banks
from shotenv.bank.files.layout import (
    CLIP_RECORD,
    MANIFEST,
    RECORDED_CONTENTS,
    THINNED_CONTENTS,
    THINNED_FILE,
    BankError,
)
from shotenv.bank.files.packed import read_packed_header
from unwrap.support import open_regular, read_npy_header


def cure_for(path: Path) -> str:
    """What mends a bank in which the file `path` is damaged."""
    if fetched_banks() in path.parents:
        name = path.relative_to(fetched_banks()).parts[0]
        return f"delete {fetched_banks() / name}, and it is fetched again"
    if path.name in (THINNED_CONTENTS, THINNED_FILE):
        return "thin the bank again, or install shotenv again where the bank is its own"
    if any((parent / RECORDED_CONTENTS).is_file() for parent in path.parents[:3]):
        return "import the recordings again"
    return f"delete {path if path.name == MANIFEST else path.parent} and render the bank again"


def check_header(path: Path, dtype: str, shape: tuple[int, ...]) -> None:
    """Refuse an array file whose header or length is not what the table of contents says.

    Raises
    ------
    BankError
        Names file, what is there, what was expected, and the cure.
    """
    # The length counts, too: a mapped file that is too short ends the process (SIGBUS) when read.
    expected = int(np.prod(shape)) * np.dtype(dtype).itemsize
    try:
        with open_regular(path) as file:
            header = read_npy_header(file)
            length = path.stat().st_size - file.tell()
    except (OSError, ValueError):
        raise BankError(f"{path} is missing or damaged; {cure_for(path)}") from None
    promised = (header.shape, header.fortran_order, header.dtype, length)
    if promised != (shape, False, np.dtype(dtype), expected):
        raise BankError(
            f"{path} holds {header.dtype} {header.shape}, {length} bytes; expected {dtype} "
            f"{shape}, {expected} bytes; {cure_for(path)}"
        )


def check_packed(path: Path, frames: int) -> None:
    """Refuse a packed array whose index or length is not what the table of contents says.

    What is in its frames is looked at when they are decompressed.

    Raises
    ------
    BankError
        Names file, what is there, what was expected, and the cure.
    """
    try:
        with open_regular(path) as file:
            found = read_packed_header(file, path.stat().st_size).frames
        if found != frames:
            raise ValueError(f"{found} frames; expected {frames}")
    except (OSError, ValueError) as error:
        said = "no such file" if isinstance(error, FileNotFoundError) else str(error)
        raise BankError(f"{path} is missing or damaged ({said}); {cure_for(path)}") from None


def require_place(folder: Path) -> None:
    """Refuse a clip's folder that holds something, but no record of a clip.

    No rendering leaves one, and what is in it may be somebody's: it is not deleted.

    Raises
    ------
    BankError
        Names the folder and the cure.
    """
    if os.path.lexists(folder) and not (folder / CLIP_RECORD).is_file():
        if folder.is_dir() and not any(folder.iterdir()):
            return
        raise BankError(
            f"{folder} holds no {CLIP_RECORD}; delete it or move it away, and run `shotenv render` "
            "again"
        )
