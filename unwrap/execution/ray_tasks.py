"""Tasks on the machines of a Ray cluster, or on a Ray of this machine alone.

Ray starts the workers, hands out cores, sends tasks and results, and runs again what was lost with
a machine. Here stands what of it we use, and how.
"""

from __future__ import annotations

import os
import secrets
import signal
import socket
import sys
import time
import uuid
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from unwrap.execution.cores import available_cores
from unwrap.execution.work import Done, Failure, Outcome, Work
from unwrap.support import StoppedWatch, say

ADDRESS = "RAY_ADDRESS"
TRIES = 4
"""So often a task is begun whose machine or process dies."""
CHECK_S = 1.0
"""How often worker processes are looked at."""
PROCESSES = Path("/proc")
"""Those of this machine; elsewhere than on Linux the folder has none."""
ANSWER_S = 5.0
"""A cluster answers within so long."""
OWN_VARIABLES = "SHOTENV_"
"""Environment variables that begin so are the same in workers as where the tasks were given."""
OBJECT_STORE_BYTES = 128 * 2**20
"""Shared memory of a Ray started here: results are small, what is large goes to files."""


@dataclass(frozen=True)
class Surroundings:
    """What a worker takes over from where the tasks were given."""

    run: str
    threads: int
    folder: str
    variables: Mapping[str, str]

    def take_over(self, work: Work) -> None:
        """Once in each process, which outlives its tasks."""
        if [self.run] == _MADE_READY:
            return
        os.environ.update(self.variables)
        # Another machine may lack the folder; then relative paths are told as missing by name.
        with suppress(OSError):
            os.chdir(self.folder)
        work.begin(self.threads)
        _MADE_READY[:] = [self.run]


_MADE_READY: list[str] = []
"""The run that this worker process was made ready for."""


def run_on_ray(
    work: Work,
    tasks: Iterator[Any],
    workers: int | None,
    threads: int | None,
    tasks_per_worker: int,
) -> Generator[Done, None, None]:
    """Tasks as they finish; see `run_tasks`."""
    with connected(workers) as ray:
        cores, gpus = _held(ray, "CPU"), _held(ray, "GPU") if work.gpu else []
        workers = workers or sum(gpus) or max(1, sum(cores) // (threads or 1))
        # No more than the smallest machine has: a task that fits nowhere would wait for ever.
        threads = threads or max(1, min(min(cores), sum(cores) // workers))
        surroundings = _surroundings(threads)
        remote = ray.remote(
            num_cpus=threads,
            num_gpus=1 if gpus else 0,
            max_retries=TRIES - 1,
            max_calls=tasks_per_worker,
            name=surroundings.run,
        )(_by_value())
        packed = ray.cloudpickle.dumps((work, surroundings))
        at_work: dict[Any, Any] = {}
        stopped = _StoppedWorkers(surroundings.run)

        def hand_out() -> None:
            while len(at_work) < workers:
                if (task := next(tasks, None)) is None:
                    return
                at_work[remote.remote(sys.path, packed, ray.cloudpickle.dumps(task))] = task

        try:
            while True:
                hand_out()
                if not at_work:
                    return
                ready, _ = ray.wait(list(at_work), num_returns=1, timeout=CHECK_S)
                stopped.end()
                done = [Done(at_work.pop(one), _fetched(ray, one)) for one in ready]
                hand_out()
                yield from done
        finally:
            for one in at_work:
                ray.cancel(one, force=True)


class _StoppedWorkers:
    """Worker processes of one run, on this machine, that a signal has stopped.

    Ray waits for them without end; one that dies it replaces, and runs its task again.
    """

    def __init__(self, run: str):
        # Ray calls a process by the task that it is at.
        self._title = f"ray::{run}".encode()
        self._watches: dict[int, StoppedWatch] = {}
        self._next_s = 0.0

    def end(self) -> None:
        """Kill those that have been stopped for some seconds; looks once in a second."""
        if time.monotonic() < self._next_s:
            return
        self._next_s = time.monotonic() + CHECK_S
        busy = [
            int(path.parent.name) for path in PROCESSES.glob("[0-9]*/cmdline") if self._is_own(path)
        ]
        self._watches = {pid: self._watches.get(pid) or StoppedWatch(pid) for pid in busy}
        for pid, watch in self._watches.items():
            if watch.hangs():
                say(f"worker {pid} was stopped; its task begins again")
                with suppress(OSError):
                    os.kill(pid, signal.SIGKILL)

    def _is_own(self, words: Path) -> bool:
        try:
            return words.read_bytes().startswith(self._title)
        except OSError:  # It has ended.
            return False


def _fetched(ray: Any, reference: Any) -> Outcome:
    """What a task has sent back, or why it could not."""
    try:
        return ray.get(reference)
    except (ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError) as error:
        return Outcome(None, Failure(f"failed: its worker died {TRIES} times ({_first(error)})"))
    # Its function is not to be found there, or its result cannot be pickled.
    except ray.exceptions.RayTaskError as error:
        return Outcome(None, Failure(f"{type(error.cause).__name__}: {error.cause}", str(error)))
    except ray.exceptions.RayError as error:
        return Outcome(None, Failure(f"failed: {_first(error)}"))


def _by_value() -> Callable[[list[str], bytes, bytes], Outcome]:
    """What a worker runs for each task.

    A function inside a function is sent as code, and not as the name of one that a worker looks up:
    it first takes over where the packages are, which is elsewhere in a checkout of the sources.
    """

    def outcome(path: list[str], packed: bytes, task: bytes) -> Outcome:
        import pickle
        import sys

        sys.path += [folder for folder in path if folder not in sys.path]
        work, surroundings = pickle.loads(packed)
        surroundings.take_over(work)
        return work.outcome(pickle.loads(task))

    return outcome


def _first(error: Exception) -> str:
    """First line of what Ray says, which can be pages."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    return lines[0] if lines else type(error).__name__


def _surroundings(threads: int) -> Surroundings:
    own = {name: value for name, value in os.environ.items() if name.startswith(OWN_VARIABLES)}
    return Surroundings(f"shotenv-{uuid.uuid4().hex}", threads, str(Path.cwd()), own)


def _held(ray: Any, resource: str) -> list[int]:
    """Cores ("CPU") or GPUs of each machine that has some.

    Raises
    ------
    ValueError
        None has cores.
    """
    alive = [node["Resources"] for node in ray.nodes() if node["Alive"]]
    counts = [count for held in alive if (count := int(held.get(resource, 0)))]
    if resource == "CPU" and not counts:
        raise ValueError(f"the Ray cluster has no cores on {len(alive)} machines; expected some")
    return counts


@contextmanager
def connected(workers: int | None) -> Iterator[Any]:
    """The module `ray`, connected to a cluster; one that was started for it ends with it.

    Tasks that are given meanwhile run there.
    """
    ray = _imported()
    if ray.is_initialized():
        yield ray
        return
    quiet = {"log_to_driver": False, "logging_level": "error"}
    if address := os.environ.get(ADDRESS):
        _require_answer(address)
        ray.init(address, **quiet)
    else:
        ray.init(
            "local",
            num_cpus=max(available_cores(), workers or 1),
            object_store_memory=OBJECT_STORE_BYTES,
            include_dashboard=False,
            **quiet,
        )
    try:
        yield ray
    finally:
        ray.shutdown()


def _require_answer(address: str) -> None:
    """Refuse a cluster that is not there; Ray would try for a minute and end the process.

    Raises
    ------
    ConnectionError
        Nobody answers at `address`.
    """
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdigit()):
        return  # "auto", "local": Ray itself says when there is none.
    try:
        socket.create_connection((host, int(port)), ANSWER_S).close()
    except OSError as error:
        raise ConnectionError(
            f"{ADDRESS} is {address!r}, where nobody answers ({error.strerror or error}); expected "
            "host:port of the machine on which `ray start --head` was called"
        ) from None


def require_ray() -> None:
    """Refuse a Ray that is not installed, or a cluster that is not there, without loading Ray.

    Raises
    ------
    ImportError, ConnectionError
    """
    if find_spec("ray") is None:
        _imported()
    if address := os.environ.get(ADDRESS):
        _require_answer(address)


def _imported() -> Any:
    """Ray, which is not to send usage statistics.

    Raises
    ------
    ImportError
        It is not installed.
    """
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    # Else Ray warns that it will one day leave the visible GPUs to tasks that ask for none.
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    # It reads this when it is imported.
    if ADDRESS not in os.environ and "ray" not in sys.modules:
        _be_private()
    try:
        import ray
    except ImportError as error:
        raise ImportError(
            f"executor 'ray' needs Ray ({error}); install it with: pip install 'shotenv[scale]'"
        ) from None
    return ray


def _be_private() -> None:
    """Let nobody else use the Ray that is started here: others need a token that no file has.

    Ray would else write one into the home folder, with which clusters that are started later ask
    all their machines for it. A choice of the user's (`RAY_AUTH_MODE`) stands.
    """
    if "RAY_AUTH_MODE" not in os.environ:
        os.environ["RAY_AUTH_MODE"] = "token"
        os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(32))
