"""Jobs in worker processes that share the cores, are replaced now and then, and never linger."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import textwrap
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from multiprocessing.connection import Connection, wait
from pathlib import Path
from types import ModuleType
from typing import Generic, TypeVar

from shotenv.render.backend.llvm import RendererError
from unwrap.support import end_with_parent

Job = TypeVar("Job")
Result = TypeVar("Result")
CHECK_S = 1.0
"""How often workers are looked at while none of them has anything to say."""
STOPPED_LIMIT_S = 5.0
"""After this long a stopped worker counts as hung."""


def run_jobs(
    function: Callable[[Job], Result],
    jobs: Iterable[Job],
    *,
    workers: int,
    jobs_per_worker: int = 50,
) -> Iterator[tuple[Job, Result]]:
    """Yield each job with `function(job)`, in the order in which they finish.

    Workers are spawned, take their share of the cores, ignore Ctrl-C (the parent ends them) and
    are replaced after `jobs_per_worker` jobs, since the renderer loses some memory with each
    scene. A job is handed out when a worker is free for it, so `jobs` may be endless. Leaving
    the loop in any way ends all workers.

    Parameters
    ----------
    function : callable
        At the top level of a module, so that it can be pickled; so must jobs and results. Where
        that module is the script itself, the script needs the usual `__main__` guard.
    jobs : iterable
        What `function` is called with.
    workers, jobs_per_worker : int
        At least 1.

    Raises
    ------
    RendererError
        A worker died or was stopped, or `function` raised. A RendererError passes as it is.
    """
    for name, value in (("workers", workers), ("jobs_per_worker", jobs_per_worker)):
        if value < 1:
            raise ValueError(f"{name} is {value}; expected at least 1")
    crew: list[_Worker] = []
    threads = max(1, available_cores() // workers)
    waiting = iter(jobs)
    try:
        for job in waiting:
            crew.append(_Worker(function, threads, jobs_per_worker))
            crew[-1].give(job)
            if len(crew) == workers:
                break
        while crew:
            # A pipe is ready when it has a result, or when its process is dead; a worker that is
            # stopped keeps silent, hence the timeout.
            ready = wait([worker.pipe for worker in crew], timeout=CHECK_S)
            for worker in crew:
                worker.check()
            for worker in [worker for worker in crew if worker.pipe in ready]:
                done = worker.take()
                crew.remove(worker)
                crew.extend(_give_next_job(worker, waiting, function, threads, jobs_per_worker))
                yield done
    finally:
        for worker in crew:
            worker.kill()


def available_cores() -> int:
    """Cores that this process may run on, which can be fewer than the machine has."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


class _Worker(Generic[Job, Result]):
    """A process with a pipe to it, and the one job that it is at."""

    def __init__(self, function: Callable[[Job], Result], threads: int, jobs_left: int):
        # Not forked: threads and locks of Dr.Jit and torch do not survive it.
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        arguments = (theirs, function, threads)
        self._process = context.Process(target=_serve, args=arguments, daemon=True)
        with nullcontext() if function.__module__ == "__main__" else _no_main_module():
            self._process.start()
        # Closed here, so that the end of the process ends the pipe.
        theirs.close()
        self._last_seen_s = time.monotonic()
        self.jobs_left = jobs_left

    def give(self, job: Job) -> None:
        """Hand out a job."""
        self._job = job
        self.jobs_left -= 1
        try:
            self.pipe.send(job)
        except BrokenPipeError:
            raise self._dead() from None

    def take(self) -> tuple[Job, Result]:
        """The finished job with its result.

        Raises
        ------
        RendererError
            The function raised, or the process is dead.
        """
        try:
            result, error, report = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            raise self._dead() from None
        if error is None:
            return self._job, result
        failure = RendererError(error if report is None else f"{self._at()} failed: {error}")
        if report is not None:
            failure.add_note(report)
        raise failure

    def check(self) -> None:
        """Raise RendererError if the process has been stopped (SIGSTOP) for some seconds."""
        now = time.monotonic()
        if not _is_stopped(self._process.pid):
            self._last_seen_s = now
        elif now - self._last_seen_s > STOPPED_LIMIT_S:
            raise RendererError(f"{self._at()} hangs: worker {self._process.pid} was stopped")

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()
        self.pipe.close()

    def retire(self) -> None:
        """Let the process end by itself; its pipe is closed, so no job will come."""
        self.pipe.close()
        self._process.join(CHECK_S)
        self._process.kill()
        self._process.join()

    def _dead(self) -> RendererError:
        self._process.join(CHECK_S)
        code = self._process.exitcode
        how = signal.Signals(-code).name if code is not None and code < 0 else f"exit code {code}"
        return RendererError(
            f"{self._at()} failed: its worker process {self._process.pid} died ({how}); "
            "if it was out of memory, use fewer workers"
        )

    def _at(self) -> str:
        return textwrap.shorten(f"job {self._job!r}", 200)


def _give_next_job(
    worker: _Worker,
    waiting: Iterator[Job],
    function: Callable[[Job], Result],
    threads: int,
    jobs_per_worker: int,
) -> list[_Worker]:
    """The worker that goes on with the next job: the same or its replacement; none at the end."""
    for job in waiting:
        if worker.jobs_left == 0:
            worker.retire()
            worker = _Worker(function, threads, jobs_per_worker)
        worker.give(job)
        return [worker]
    worker.retire()
    return []


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


def _serve(pipe: Connection, function: Callable[[Job], Result], threads: int) -> None:
    """Life of a worker process: jobs come in, (result, error, traceback) go out."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent()
    _limit_threads(threads)
    while True:
        try:
            job = pipe.recv()
        except EOFError:
            return
        try:
            pipe.send((function(job), None, None))
        except RendererError as error:
            pipe.send((None, str(error), None))
        except Exception as error:
            pipe.send((None, f"{type(error).__name__}: {error}", traceback.format_exc()))


def _limit_threads(threads: int) -> None:
    """Keep what computes in this process to its share; threads of many workers thrash."""
    if "torch" in sys.modules:  # Loaded with the function, by those that use it.
        sys.modules["torch"].set_num_threads(threads)
    try:
        import drjit
        from threadpoolctl import threadpool_limits
    except ImportError:
        return  # The first job that renders says so in a better way.
    drjit.set_thread_count(threads)
    # NumPy's own threads wait for work by spinning: for the lens, an eighth of a worker's time.
    threadpool_limits(threads)


def _is_stopped(pid: int | None) -> bool:
    """Whether a signal has stopped the process; known on Linux only."""
    if sys.platform != "linux":
        return False
    try:
        status = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] in "Tt"
