"""What an error says, or a value looks like, made fit for one line of an error's message."""

from __future__ import annotations

from typing import Any

LONGEST, LONGEST_VALUE = 200, 120
"""Characters kept: some errors quote all that they were given, and tensors show their numbers."""


def in_one_line(error: Exception) -> str:
    """What `error` says, in one line; its name where it says nothing.

    What the system refuses is told without its path, which the message around it begins with.

    Examples
    --------
    >>> in_one_line(ValueError("bad\\nmagic")), in_one_line(EOFError())
    ('bad magic', 'EOFError')
    >>> in_one_line(FileNotFoundError(2, "No such file or directory", "a.npy"))
    'no such file'
    """
    if isinstance(error, FileNotFoundError):
        return "no such file"
    if isinstance(error, OSError) and error.strerror:
        return error.strerror[:LONGEST]
    return " ".join(str(error).split())[:LONGEST] or type(error).__name__


def in_short(value: Any) -> str:
    """`value` as Python writes it, in one line, and cut where it is long.

    Examples
    --------
    >>> in_short("floor"), in_short(b"0" * 500)[-7:]
    ("'floor'", '0000...')
    """
    told = " ".join(repr(value).split())
    return told if len(told) <= LONGEST_VALUE else f"{told[:LONGEST_VALUE]}..."
