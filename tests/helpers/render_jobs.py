"""Jobs for the worker tests; worker processes import them by name."""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np  # noqa: F401 - loads the libraries that `blas_threads` counts.
from threadpoolctl import threadpool_info

from shotenv.render.backend.workers import run_jobs


def squared(number: int) -> tuple[int, int]:
    return number * number, os.getpid()


def blas_threads(_: int) -> set[int]:
    """Threads of each library of linear algebra that NumPy loads."""
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def fail_at_three(number: int) -> int:
    if number == 3:
        raise KeyError("no such lamp")
    return number


def killed_at_three(number: int) -> int:
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def stopped_at_three(number: int) -> int:
    if number == 3:
        # A worker that hangs: it neither answers nor ends.
        os.kill(os.getpid(), signal.SIGSTOP)
    return number


def unpicklable_at_three(number: int):
    return number if number != 3 else lambda: number


def sleep(folder: str) -> None:
    Path(folder, f"{os.getpid()}").touch()
    time.sleep(60)


if __name__ == "__main__":
    for _ in run_jobs(sleep, [sys.argv[1]] * 4, workers=2):
        pass
