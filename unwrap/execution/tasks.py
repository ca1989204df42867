"""Tasks in workers, of this machine or of many, with one function for both."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from typing import TypeVar, get_args

from unwrap.execution.cores import available_cores
from unwrap.execution.processes import run_in_processes
from unwrap.execution.ray_tasks import ADDRESS, require_ray, run_on_ray
from unwrap.execution.work import Executor, Work, task_name
from unwrap.support import require_choice

Task = TypeVar("Task")
Result = TypeVar("Result")
MOST_PER_CORE = 16
"""Workers for each core: more would only take memory."""
RUNNERS = {"local": run_in_processes, "ray": run_on_ray}


def check_execution(executor: Executor, workers: int | None) -> None:
    """Refuse workers that cannot be had: commands ask before they work for minutes.

    Raises
    ------
    ValueError
        Another executor, or a number of workers that is below 1, or beyond what one machine bears.
    ImportError, ConnectionError
        Ray is not installed, or nobody answers where `RAY_ADDRESS` says.
    """
    require_choice(get_args(Executor), executor=executor)
    if workers is not None and workers < 1:
        raise ValueError(f"workers is {workers}; expected at least 1")
    on_cluster = executor == "ray" and ADDRESS in os.environ
    most = max(64, MOST_PER_CORE * available_cores())
    if workers is not None and workers > most and not on_cluster:
        raise ValueError(f"workers is {workers}; expected at most {most} on this machine")
    if executor == "ray":
        require_ray()


def run_tasks(
    function: Callable[[Task], Result],
    tasks: Iterable[Task | None],
    *,
    executor: Executor = "local",
    workers: int | None = None,
    threads: int | None = None,
    gpu: bool = False,
    tasks_per_worker: int = 50,
    prepare: Callable[[int], None] | None = None,
    passing: tuple[type[Exception], ...] = (),
    name: Callable[[Task], str] = task_name,
    keep_going: bool = False,
) -> Iterator[tuple[Task, Result | Exception]]:
    """Yield each task with `function(task)`, in the order in which they finish.

    A task is handed out when a worker is free for it, so `tasks` may be endless. Leaving the loop
    in any way ends what is at work.

    Parameters
    ----------
    function : callable
        At the top level of a module, so that it can be pickled; so must tasks and results. Where
        that module is the script itself, the script needs the usual `__main__` guard.
    tasks : iterable
        What `function` is called with. None stands for: nothing until another has finished.
    executor : "local" or "ray"
        Processes of this machine that ignore Ctrl-C (the parent ends them); or tasks of the Ray
        cluster that the environment variable `RAY_ADDRESS` names, where it is set, else of a Ray
        that is started here and ends with the loop. What ran on a machine or in a process that
        died runs again, see `ray_tasks.TRIES`.
    workers : int, optional
        Tasks at a time; by default one per core, of all machines together.
    threads : int, optional
        Cores that a task computes on; by default its share of them.
    gpu : bool
        Whether each task has a GPU of its own, on a cluster that has some. The processes of one
        machine share what there is.
    tasks_per_worker : int
        After so many tasks a process is replaced by a new one: the renderer, for one, loses some
        memory with each scene.
    prepare : callable, optional
        Called in each process before its first task, with `threads`.
    passing : tuple of types
        Errors of `function` that are raised as they are. Any other is told with the task's name.
    name : callable
        What a task is called in messages.
    keep_going : bool
        Whether the others run on after one has failed: what would be raised comes as its result.

    Raises
    ------
    WorkerError
        `function` raised, or a worker died (with "ray", too often) or was stopped.
    ValueError, ImportError, ConnectionError
        As `check_execution`.
    """
    for field, value in (("threads", threads), ("tasks_per_worker", tasks_per_worker)):
        if value is not None and value < 1:
            raise ValueError(f"{field} is {value}; expected at least 1")
    check_execution(executor, workers)
    work = Work(function, prepare, passing, gpu)
    run = RUNNERS[executor](work, iter(tasks), workers, threads, tasks_per_worker)
    with closing(run):
        for task, (result, failure) in run:
            if failure is None:
                yield task, result
                continue
            error = failure.error(name(task))
            if not keep_going:
                raise error
            yield task, error
