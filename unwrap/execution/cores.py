"""Cores that there are, and the share of them that a worker computes on."""

from __future__ import annotations

import os
import sys


def available_cores() -> int:
    """Cores that this process may run on, which can be fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def limit_threads(threads: int) -> None:
    """Keep torch and NumPy to so many threads in this process; those of many workers thrash."""
    if "torch" in sys.modules:  # Loaded with the function, by those that use it.
        sys.modules["torch"].set_num_threads(threads)
    try:
        from threadpoolctl import threadpool_limits
    except ImportError:
        return  # It comes with the renderer, to which it matters.
    # NumPy's own threads wait for work by spinning: for a lens, an eighth of a worker's time.
    threadpool_limits(threads)
