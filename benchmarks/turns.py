"""Two things timed in turns, so that a slow spell of the machine hits both."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from time import thread_time


def alternately(
    first: Callable[[], object],
    second: Callable[[], object],
    repeats: int,
    clock: Callable[[], float] = thread_time,
) -> tuple[float, float]:
    """Median seconds of both; by default those of the processor on this thread."""
    times: tuple[list[float], list[float]] = ([], [])
    for _ in range(repeats):
        for function, taken in zip((first, second), times, strict=True):
            start = clock()
            function()
            taken.append(clock() - start)
    return median(times[0]), median(times[1])
