"""Folders that workers write to, which may run on other machines than where they were made."""

from __future__ import annotations

import contextlib
import platform
import time
from collections.abc import Iterator
from pathlib import Path

from unwrap.execution.work import Executor, WorkerError

SEEN_S = 60.0
"""After so long a file of another machine is seen by this one: NFS keeps for a minute what was
not there."""
CHECK_S = 0.5
"""How often is looked."""


def visible(folder: Path) -> Path:
    """`folder`, where this machine sees it; a worker asks before it begins a task.

    Raises
    ------
    WorkerError
        It does not: the message names the machine and the folder.
    """
    if not folder.is_dir():
        raise WorkerError(
            f"machine {platform.node()} does not see the folder {folder}; expected one that all "
            "machines share"
        )
    return folder


def wait_for_file(file: Path, executor: Executor) -> bool:
    """Wait for `file`, of a task that has ended and may have run elsewhere; whether it is there."""
    end = time.monotonic() + (SEEN_S if executor == "ray" else 0.0)
    while not file.is_file():
        if time.monotonic() >= end:
            return False
        time.sleep(CHECK_S)
    return True


@contextlib.contextmanager
def output_to(file: Path) -> Iterator[None]:
    """Bars and lines of one task among many go to a file, made anew."""
    with (
        file.open("w", encoding="utf-8") as log,
        contextlib.redirect_stderr(log),
        contextlib.redirect_stdout(log),
    ):
        yield
