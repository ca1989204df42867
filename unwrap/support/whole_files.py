"""Files read whole: regular ones below a limit; whatever else lies there is refused, not read.

A named pipe would wait for ever for who writes to it, a device never ends, and a file of gigabytes
fills the memory before anybody looks at what it holds. Messages here begin with what is wrong, not
with the path, which the message around them begins with.
"""

from __future__ import annotations

import json
import os
import stat
import sys
from io import BufferedReader
from pathlib import Path
from typing import Any, NoReturn

from unwrap.support.error_text import in_one_line

MOST_JSON_BYTES = 1 << 24
"""Of tables that a person or a program reads at once; the largest of this project has some 4 MB."""


def open_regular(path: Path, most_bytes: int = sys.maxsize) -> BufferedReader:
    """The open file `path`, without waiting for anybody.

    Raises
    ------
    OSError
        It is missing or may not be read.
    ValueError
        It is no regular file, or larger than `most_bytes`.
    """
    # Without waiting: a pipe opens at once, and is then told by what it is.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        found = os.fstat(handle)
        if not stat.S_ISREG(found.st_mode):
            raise ValueError("not a regular file")
        if found.st_size > most_bytes:
            raise ValueError(f"{found.st_size} bytes; expected at most {most_bytes}")
    except BaseException:
        os.close(handle)
        raise
    return os.fdopen(handle, "rb")


def require_regular(path: Path, most_bytes: int) -> None:
    """Raise what `open_regular` does; for readers that open files themselves."""
    open_regular(path, most_bytes).close()


def read_regular(path: Path, most_bytes: int) -> bytes:
    """Content of `path`; raises what `open_regular` does."""
    with open_regular(path, most_bytes) as file:
        # One more than there may be, in case it grows meanwhile.
        content = file.read(most_bytes + 1)
    if len(content) > most_bytes:
        raise ValueError(f"more than {most_bytes} bytes")
    return content


def read_json(path: Path, most_bytes: int = MOST_JSON_BYTES) -> dict[str, Any]:
    """The table in a JSON file.

    Raises
    ------
    FileNotFoundError
        It is missing; in a sentence that needs no path.
    ValueError
        It cannot be read, is no regular file or larger than `most_bytes`, is not JSON, holds NaN or
        infinity, or is no table.
    """
    try:
        content = json.loads(read_regular(path, most_bytes).decode(), parse_constant=_no_number)
    except FileNotFoundError:
        raise
    # Nested too deep, the last one.
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(in_one_line(error)) from None
    if not isinstance(content, dict):
        raise ValueError("not a table")
    return content


def _no_number(word: str) -> NoReturn:
    raise ValueError(f"holds {word}, which is no JSON")
