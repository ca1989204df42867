"""Progress of long work on stderr: a bar on a terminal, a line every few seconds elsewhere."""

from __future__ import annotations

import sys
from typing import TextIO

from tqdm import tqdm

SECONDS_PER_LINE = 5.0


class _Lines:
    """A stream on which a bar that redraws itself becomes a log of lines."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> None:
        # tqdm goes back to the start of the line with "\r", which a log file would keep.
        line = text.strip("\r\n")
        if line.strip():
            self._stream.write(line + "\n")

    def flush(self) -> None:
        self._stream.flush()


def progress(total: int, what: str, unit: str, *, done: int = 0) -> tqdm:
    """A progress bar with rate and time left; call `.update(count)`.

    Parameters
    ----------
    total, done : int
        Units of work in all, and those that an earlier run has done already.
    what, unit : str
        What is being done, and the name of one unit.
    """
    terminal = sys.stderr.isatty()
    # Time alone decides when to draw (`miniters=1`): tqdm would else learn to draw every so many
    # units, and fall silent as soon as they take longer.
    return tqdm(
        total=total,
        initial=done,
        desc=what,
        unit=f" {unit}",
        mininterval=0.2 if terminal else SECONDS_PER_LINE,
        maxinterval=1.0 if terminal else SECONDS_PER_LINE,
        miniters=1,
        file=sys.stderr if terminal else _Lines(sys.stderr),
        ascii=None if terminal else " #",
        ncols=None if terminal else 100,
    )


def say(text: str) -> None:
    """One line of what is going on, on stderr."""
    print(text, file=sys.stderr, flush=True)
