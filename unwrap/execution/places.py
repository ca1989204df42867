"""Folders that workers write to, which may run on other machines than where they were made."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Iterator
from pathlib import Path

from unwrap.execution.work import WorkerError


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


@contextlib.contextmanager
def output_to(file: Path) -> Iterator[None]:
    """Bars and lines of one task among many go to a file, made anew."""
    with (
        file.open("w", encoding="utf-8") as log,
        contextlib.redirect_stderr(log),
        contextlib.redirect_stdout(log),
    ):
        yield
