"""The C library's memory: whether what tensors give back stays with the process."""

from __future__ import annotations

import ctypes
import sys

TRIM_THRESHOLD, MMAP_MAX = -1, -4
"""Parameters of glibc's mallopt, from malloc.h."""


def keep_freed_memory() -> bool:
    """Let the process keep freed memory for its next tensors; whether it can be told to.

    By default glibc takes large blocks from the system and gives them back when they are freed, so
    that each step of a training has its gigabytes of maps cleared and mapped anew, page by page.
    What was the most at any time is kept until the process ends. Of other C libraries nothing is
    asked.
    """
    if not sys.platform.startswith("linux"):
        return False
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    return bool(mallopt(MMAP_MAX, 0)) and bool(mallopt(TRIM_THRESHOLD, -1))
