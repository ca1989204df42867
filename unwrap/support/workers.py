"""Workers and those who started them: neither goes on for one that is gone or has stopped."""

from __future__ import annotations

import math
import multiprocessing
import os
import sys
import threading
import time
from pathlib import Path

STOPPED_LIMIT_S = 5.0
"""After this long a stopped process counts as hung."""


def end_with_parent() -> None:
    """Let this process, which another one started as a worker, end as soon as that one has.

    However that one ends: nobody else would tell a worker, which would go on computing what nobody
    waits for.
    """
    threading.Thread(target=_end_after_parent, daemon=True).start()


def _end_after_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


class StoppedWatch:
    """Looks at a worker now and then, and says whether it hangs.

    One that a signal has stopped keeps silent, and would be waited for without end.
    """

    def __init__(self, pid: int | None):
        self._pid = pid
        self._since_s = math.inf

    def hangs(self) -> bool:
        """Whether the process has been stopped (SIGSTOP) for some seconds; ask every second."""
        now = time.monotonic()
        # From when it was first seen so: whoever asks may have been stopped, too, or away.
        self._since_s = min(self._since_s, now) if _is_stopped(self._pid) else math.inf
        return now - self._since_s > STOPPED_LIMIT_S


def _is_stopped(pid: int | None) -> bool:
    """Whether a signal has stopped the process; known on Linux only."""
    if sys.platform != "linux":
        return False
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] in "Tt"
