"""Atomic files: written beside under a hidden name, flushed to disk, then renamed."""

from __future__ import annotations

import json
import os
import platform
import shutil
import uuid
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from pathlib import Path
from typing import Any, BinaryIO

LONGEST_NAME = 64
"""Bytes of a name that its hidden form has; a file system takes 255 of the whole."""


@contextmanager
def replacing(path: Path) -> Iterator[BinaryIO]:
    """A file to write, which replaces `path` at the end, or leaves it as it was.

    Raises
    ------
    OSError
        No space or no permission; nothing was overwritten.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    writing = unfinished(path)
    try:
        with writing.open("xb") as file:
            yield file
            file.flush()
            # Without this a crash soon after the rename could leave an empty file under `path`.
            os.fsync(file.fileno())
        writing.replace(path)
    except BaseException as error:  # Ctrl-C, too, must leave nothing lying about.
        writing.unlink(missing_ok=True)
        # That a disk is full is told without a name by those who write. What has no number is an
        # error of whoever gave the content, with words of its own.
        if isinstance(error, OSError) and error.filename is None and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from None
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
    building = unfinished(folder)
    try:
        building.mkdir()
        yield building
        building.replace(folder)
    finally:
        shutil.rmtree(building, ignore_errors=True)


def unfinished(path: Path) -> Path:
    """A hidden name beside `path` for what becomes it when it is whole.

    Beside it, since nothing can be renamed from one file system to another. What processes that
    were killed have left under such names of `path` is deleted.
    """
    # The name tells machine and process: another machine that shares the folder knows nothing of
    # the processes of this one.
    own = os.fsdecode(os.fsencode(path.name)[:LONGEST_NAME])
    stem = f".{own}.{zlib.crc32(platform.node().encode()):08x}-"
    for left in path.parent.glob(f"{escape(stem)}*"):
        process = left.name.removeprefix(stem).partition("-")[0]
        if process.isdecimal() and not _is_running(int(process)):
            shutil.rmtree(left, ignore_errors=True) if left.is_dir() else left.unlink(True)
    return path.with_name(f"{stem}{os.getpid()}-{uuid.uuid4().hex[:8]}")


def _is_running(process: int) -> bool:
    if os.name != "posix":  # Elsewhere signal 0 is no question.
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:  # Somebody else's.
        pass
    return True


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
