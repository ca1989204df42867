"""Worker processes of this machine that share its cores, are replaced now and then, and never
linger.
"""

from __future__ import annotations

import multiprocessing
import pickle
import signal
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager, nullcontext, suppress
from multiprocessing.connection import Connection, wait
from types import ModuleType
from typing import Any

from unwrap.execution.cores import available_cores
from unwrap.execution.work import Done, Failure, Outcome, Work
from unwrap.support import StoppedWatch, end_with_parent

CHECK_S = 1.0
"""How often workers are looked at while none of them has anything to say."""


def run_in_processes(
    work: Work,
    tasks: Iterator[Any],
    workers: int | None,
    threads: int | None,
    tasks_per_worker: int,
) -> Generator[Done, None, None]:
    """Tasks as they finish; see `run_tasks`."""
    cores = available_cores()
    workers = workers or cores
    crew = _Crew(work, workers, threads or max(1, cores // workers), tasks_per_worker)
    try:
        while True:
            crew.hand_out(tasks)
            if not crew.busy:
                return
            done = crew.finished()
            # At once, and not only when whoever takes the results comes back for more.
            crew.hand_out(tasks)
            yield from done
    finally:
        crew.end()


class _Crew:
    """Workers that are at a task, and those that wait for one."""

    def __init__(self, work: Work, workers: int, threads: int, tasks_per_worker: int):
        self._begun = (work, threads, tasks_per_worker)
        self._workers = workers
        self.busy: list[_Worker] = []
        self._idle: list[_Worker] = []

    def hand_out(self, tasks: Iterator[Any]) -> None:
        """Give a task to each worker that is free, as long as there are some."""
        while len(self.busy) < self._workers:
            if (task := next(tasks, None)) is None:
                return
            self.busy.append(self._idle.pop() if self._idle else _Worker(*self._begun))
            self.busy[-1].give(task)

    def finished(self) -> list[Done]:
        """Tasks that have come to their end, after a second at the latest."""
        # A pipe is ready when it has a result, or when its process is dead; a worker that is
        # stopped keeps silent, hence the timeout.
        ready = wait([worker.pipe for worker in self.busy], timeout=CHECK_S)
        done = []
        for worker in tuple(self.busy):
            outcome = worker.outcome() if worker.pipe in ready else worker.hung()
            if outcome is None:
                continue
            self.busy.remove(worker)
            if worker.tasks_left:
                self._idle.append(worker)
            else:
                worker.retire()
            done.append(Done(worker.task, outcome))
        return done

    def end(self) -> None:
        """No process is left."""
        for worker in self.busy:
            worker.kill()
        for worker in self._idle:
            worker.retire()


class _Worker:
    """A process with a pipe to it, and the one task that it is at."""

    def __init__(self, work: Work, threads: int, tasks_left: int):
        # Not forked: threads and locks of Dr.Jit and torch do not survive it.
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        # As bytes: what the function imports, torch perhaps, is loaded by a process that already
        # ends with its parent.
        told = (theirs, pickle.dumps(work), threads)
        self._process = context.Process(target=_serve, args=told, daemon=True)
        with nullcontext() if work.function.__module__ == "__main__" else _no_main_module():
            self._process.start()
        # Closed here, so that the end of the process ends the pipe.
        theirs.close()
        self._watch = StoppedWatch(self._process.pid)
        self.tasks_left = tasks_left
        self.task: Any = None

    def give(self, task: Any) -> None:
        """Hand out a task."""
        self.task = task
        self.tasks_left -= 1
        # A process that is dead is found by its pipe, which is ready then.
        with suppress(BrokenPipeError):
            self.pipe.send(task)

    def outcome(self) -> Outcome:
        """What has become of the task; where the process is dead, that."""
        try:
            return self.pipe.recv()
        # In the middle of a result that is larger than the pipe, it is another one than before it.
        except (EOFError, OSError):
            return self._lost(self._death())
        except Exception as error:  # a result that can be pickled, but not made again of that
            return Outcome(None, Failure(f"failed: {type(error).__name__}: {error}"))

    def hung(self) -> Outcome | None:
        """The end of a process that has been stopped (SIGSTOP) for some seconds, None of others."""
        if self._watch.hangs():
            return self._lost(f"hangs: worker {self._process.pid} was stopped")
        return None

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()
        self.pipe.close()

    def retire(self) -> None:
        """Let the process end by itself; its pipe is closed, so no task will come."""
        self.pipe.close()
        self._process.join(CHECK_S)
        self._process.kill()
        self._process.join()

    def _lost(self, message: str) -> Outcome:
        # Of no more use; what is left of it goes as that of a worker which has done its share.
        self._process.kill()
        self.tasks_left = 0
        return Outcome(None, Failure(message))

    def _death(self) -> str:
        self._process.join(CHECK_S)
        code = self._process.exitcode
        how = signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"
        return (
            f"failed: its worker process {self._process.pid} died ({how}); if it was out of "
            "memory, use fewer workers"
        )


@contextmanager
def _no_main_module() -> Iterator[None]:
    """Hide `__main__`, which a spawned process imports anew.

    A script that renders at its top level would otherwise run again in the worker, up to the
    same rendering, and wait there for its own parent.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


def _serve(pipe: Connection, pickled: bytes, threads: int) -> None:
    """Life of a worker process: tasks come in, their outcomes go out."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    work: Work = pickle.loads(pickled)
    work.begin(threads)
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        outcome = work.outcome(task)
        try:
            pipe.send(outcome)
        except Exception as error:  # a result that cannot be pickled
            pipe.send(work.failed(error))
