"""What workers are to do with each task, and what comes back of it: a result or a failure."""

from __future__ import annotations

import textwrap
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from unwrap.execution.cores import limit_threads

Executor = Literal["local", "ray"]


class WorkerError(RuntimeError):
    """A task failed or its worker died; the message says in one sentence which and why."""


@dataclass(frozen=True)
class Work:
    """The same for all tasks; see `run_tasks` for what the fields mean."""

    function: Callable[[Any], Any]
    prepare: Callable[[int], None] | None
    passing: tuple[type[Exception], ...]
    gpu: bool = False

    def begin(self, threads: int) -> None:
        """In a worker, before its first task."""
        limit_threads(threads)
        if self.prepare is not None:
            self.prepare(threads)

    def outcome(self, task: Any) -> Outcome:
        """In a worker: what becomes of one task."""
        try:
            return Outcome(self.function(task), None)
        except Exception as error:
            return self.failed(error)

    def failed(self, error: Exception) -> Outcome:
        """That of a task which raised `error`."""
        # Sent as text: not every error can be pickled, or made again of what it was pickled to.
        if isinstance(error, self.passing):
            return Outcome(None, Failure(str(error), None, type(error)))
        report = traceback.format_exc()
        return Outcome(None, Failure(f"{type(error).__name__}: {error}", report))


class Failure(NamedTuple):
    """Why a task has no result.

    Attributes
    ----------
    message : str
    report : str, optional
        Traceback of the worker.
    passing : type of Exception, optional
        Of an error that is raised as it is.
    """

    message: str
    report: str | None = None
    passing: type[Exception] | None = None

    def error(self, name: str) -> Exception:
        """What is raised where the tasks were given, of the task called `name`."""
        if self.passing is not None:
            return self.passing(self.message)
        error = WorkerError(f"{name} {self.message}")
        if self.report is not None:
            error = WorkerError(f"{name} failed: {self.message}")
            error.add_note(self.report)
        return error


class Outcome(NamedTuple):
    """Result of a task, or its failure."""

    result: Any
    failure: Failure | None


class Done(NamedTuple):
    """A task that has come to its end."""

    task: Any
    outcome: Outcome


def task_name(task: Any) -> str:
    """What a task is called in messages, unless the caller knows better."""
    return textwrap.shorten(f"task {task!r}", 200)
