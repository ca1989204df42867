"""HDF5 files, opened so that what is wrong with them is one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from unwrap.cameras.files.stored_frames import BROKEN
from unwrap.support import in_one_line


@contextmanager
def opened_hdf5(path: Path) -> Iterator[Any]:
    """The open file; what is raised inside names it.

    Raises
    ------
    ImportError
        h5py is not installed.
    ValueError
        The file is missing or damaged, or what the body raises of it.
    """
    try:
        import h5py
    except ImportError:
        raise ImportError(
            f"{path}: reading HDF5 needs h5py, which is not installed; pip install "
            "'shotenv[cameras]'"
        ) from None
    try:
        if not path.is_file():
            raise ValueError("no such file")
        with h5py.File(path, "r") as file:
            yield file
    except BROKEN as error:
        raise ValueError(f"{path}: {in_one_line(error)}") from None
