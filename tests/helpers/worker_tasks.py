"""Tasks for the worker tests; worker processes import them by name."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np  # noqa: F401 - loads the libraries that `blas_threads` counts.
from threadpoolctl import threadpool_info

from unwrap.execution import run_tasks


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


def killed_while_it_sends(own: Path) -> bytes:
    """Once there is a file `own`.go, whose writer takes nothing until this process is dead."""
    if own.name == "first":
        return b""
    while not own.with_suffix(".go").exists():
        time.sleep(0.01)
    own.write_text(str(os.getpid()))
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGKILL)).start()
    return bytes(50_000_000)


class OneWayError(Exception):
    """Pickled to its message alone, of which it cannot be made again."""

    def __init__(self, number: int, reason: str):
        super().__init__(f"{number}: {reason}")


def unreadable_at_three(number: int):
    return OneWayError(number, "broken") if number == 3 else number


def stopped_once(mark: str) -> str:
    """Is stopped at the first try, of which the file `mark` tells the second."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGSTOP)
    return "through"


_PREPARED: list[int] = []


def prepare(threads: int) -> None:
    _PREPARED.append(threads)


def prepared_with(_: int) -> list[int]:
    return _PREPARED


def surroundings(_: int) -> tuple[list[int], str | None, str]:
    return _PREPARED, os.environ.get("SHOTENV_TEST"), str(Path.cwd())


def gpus_of_company(task: tuple[Path, int, int]) -> list[str]:
    """Numbers of the GPUs that Ray gives this task, once all of them are at work at one time."""
    import ray

    folder, company, number = task
    (folder / str(number)).touch()
    while len(list(folder.iterdir())) < company:
        time.sleep(0.05)
    return [str(gpu) for gpu in ray.get_gpu_ids()]


def killed_once(mark: str) -> str:
    """Dies at the first try, of which the file `mark` tells the second."""
    if not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "through"


def found_nowhere() -> Callable[[int], int]:
    """A function of a module that only this process has."""
    module = ModuleType("nowhere_to_be")
    exec("def same(number): return number", module.__dict__)
    sys.modules["nowhere_to_be"] = module
    return module.same


def sleep(folder: str) -> None:
    Path(folder, f"{os.getpid()}").touch()
    time.sleep(60)


if __name__ == "__main__":
    folder, executor = sys.argv[1:]
    for _ in run_tasks(sleep, [folder] * 4, executor=executor, workers=2):
        pass
