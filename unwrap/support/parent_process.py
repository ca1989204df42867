"""Workers that do not outlive what started them."""

from __future__ import annotations

import multiprocessing
import os
import threading


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
