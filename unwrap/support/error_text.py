"""What an error says, made fit for one line of another error's message."""

from __future__ import annotations

LONGEST = 200
"""Characters kept: some errors quote all that they were given."""


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
