"""What this package changes of the whole process: torch's threads, the C library's memory.

All of it stands here, so that whoever wonders why a process behaves differently after a call looks
in one file. Two changes stand where they belong: `unwrap.networks.openvino` keeps OpenVINO from
sending statistics, and pools of threads set torch's threads of their own (`unwrap.training.data`).
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import torch

TRIM_THRESHOLD, MMAP_MAX = -1, -4
"""Parameters of glibc's mallopt, from malloc.h."""


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Torch computes with `count` threads inside the context, and as before behind it.

    Examples
    --------
    >>> before = torch.get_num_threads()
    >>> with torch_threads(1):
    ...     torch.get_num_threads()
    1
    >>> torch.get_num_threads() == before
    True
    """
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def keep_freed_memory() -> bool:
    """Let the process keep freed memory for its next tensors, until it ends.

    By default glibc takes large blocks from the system and gives them back when they are freed:
    each step of a training has its gigabytes of feature maps cleared and mapped anew, page by page.
    Afterwards the process holds on to the most memory that it ever needed.

    Returns
    -------
    bool
        Whether it was done; False with other C libraries, which are left alone.
    """
    if not sys.platform.startswith("linux"):
        return False
    # musl and others have no mallopt.
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is None:
        return False
    # No block has a mapping of its own, and the top of the heap is never given back.
    return bool(mallopt(MMAP_MAX, 0)) and bool(mallopt(TRIM_THRESHOLD, -1))
