"""Two things timed in turns, so that a slow spell of the machine hits both."""

from __future__ import annotations

from collections.abc import Callable
from time import thread_time


def alternately(
    first: Callable[[], object],
    second: Callable[[], object],
    repeats: int,
    clock: Callable[[], float] = thread_time,
    *,
    settled: bool = False,
) -> tuple[float, float]:
    """Seconds of both in the turn whose ratio is the median of all turns.

    By default those of the processor on this thread. `settled` lets each run once more before it
    is timed, so that it does not find the threads of the other still awake.
    """
    turns = [
        (seconds(first, clock, settled), seconds(second, clock, settled)) for _ in range(repeats)
    ]
    # A whole turn and not two medians, so that the seconds that are reported give the ratio.
    return sorted(turns, key=lambda turn: turn[0] / turn[1])[repeats // 2]


def seconds(function: Callable[[], object], clock: Callable[[], float], settled: bool) -> float:
    """Time that `function` takes."""
    if settled:
        function()
    start = clock()
    function()
    return clock() - start
