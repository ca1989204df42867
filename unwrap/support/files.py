"""Atomic files: written beside under a temporary name, flushed to disk, then renamed."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write, which replaces `path` at the end, or leaves it as it was.

    Raises
    ------
    OSError
        No space or no permission; nothing was overwritten.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    # In the same folder: a file can only be renamed within its file system.
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            # Without this a crash soon after the rename could leave an empty file under `path`.
            os.fsync(file.fileno())
        Path(name).chmod(0o644)  # mkstemp makes files that only their owner may read.
        Path(name).replace(path)
    except BaseException:  # Ctrl-C, too, must leave nothing lying about.
        Path(name).unlink(missing_ok=True)
        raise


@contextmanager
def building_folder(folder: Path) -> Iterator[Path]:
    """A folder to fill, which becomes `folder` at the end, or leaves nothing.

    Raises
    ------
    ValueError
        `folder` is there and not empty.
    """
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise ValueError(f"{folder} is not an empty folder; nothing is written over")
    folder.parent.mkdir(parents=True, exist_ok=True)
    # Beside it: a folder can only be renamed within its file system.
    building = Path(tempfile.mkdtemp(dir=folder.parent, prefix=f".{folder.name}."))
    try:
        building.chmod(0o755)  # mkdtemp makes folders that only their owner may enter.
        yield building
        building.replace(folder)
    finally:
        shutil.rmtree(building, ignore_errors=True)


def write_bytes(path: Path, content: bytes) -> None:
    """Replace `path` by `content`, or leave it as it was; see `replacing`."""
    with replacing(path) as file:
        file.write(content)


def write_text(path: Path, text: str) -> None:
    """Replace `path` by `text` in UTF-8."""
    write_bytes(path, text.encode("utf-8"))


def write_json(path: Path, value: Any) -> None:
    """Replace `path` by `value` as JSON; NaN is refused, since JSON has none."""
    write_text(path, json.dumps(value, indent=1, allow_nan=False) + "\n")
