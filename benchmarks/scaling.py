"""Tasks on a Ray, over tasks in processes of this machine; two workers over one; cost of a task.

Rates are steady ones, of a Ray that runs, after each worker has come back once: to start Ray takes
some seconds, and to load the renderer some more, however long the work is. Ratios are medians of
turns, for a machine may be half as fast again a minute later.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

from benchmarks.rows import row
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.clip_rendering import render_missing
from shotenv.config import BankConfig, SensorConfig, find_config, merged, read_config
from shotenv.render.backend import limit_threads
from unwrap.execution import Executor, run_tasks
from unwrap.execution.ray_tasks import connected

RENDERING_GOAL, STUDY_GOAL, OVERHEAD_GOAL_MS = 0.9, 0.9, 50.0
"""Share of the local rate that Ray keeps; share of twice the rate of one worker that two have;
milliseconds that a task costs beside its work."""
TURNS, CELLS, CELL_S = 5, 20, 0.3
"""In each turn so many cells of a study, on one worker and on two."""
EMPTY_TASKS = 300
RUNNERS: tuple[Executor, ...] = ("local", "ray")


class Pace(NamedTuple):
    """Seconds until the first result, and from task to task after that."""

    start_s: float
    task_s: float


def run() -> list[dict[str, Any]]:
    with connected(2):  # One Ray that serves all that is asked of it.
        return [rendering(), *(study(executor) for executor in RUNNERS), overhead()]


def pace(
    function: Callable[[Any], Any],
    tasks: Iterable[Any],
    executor: Executor,
    workers: int,
    **options: Any,
) -> Pace:
    """How fast tasks come back."""
    began, ends = perf_counter(), []
    for _ in run_tasks(function, tasks, executor=executor, workers=workers, **options):
        ends.append(perf_counter())
    return Pace(ends[0] - began, (ends[-1] - ends[workers - 1]) / (len(ends) - workers))


def rendering() -> dict[str, Any]:
    """Clips of a small bank on two workers, in turns."""
    with tempfile.TemporaryDirectory() as folder:
        turns = [
            [_rendered(Path(folder, f"{executor}-{turn}"), executor) for executor in RUNNERS]
            for turn in range(TURNS)
        ]
    local, ray = _middle(turns)
    note = "; ".join(
        f"{name} {1e3 * one.task_s:.0f} ms a clip, the first after {one.start_s:.1f} s"
        for name, one in (("local", local), ("Ray", ray))
    )
    ratio = local.task_s / ray.task_s
    return row("rendering by Ray over local, 2 workers", ratio, ">=", RENDERING_GOAL, note)


def _middle(turns: list[list[Pace]]) -> list[Pace]:
    """The turn whose ratio is the median of all."""
    return sorted(turns, key=lambda turn: turn[0].task_s / turn[1].task_s)[len(turns) // 2]


def _rendered(folder: Path, executor: Executor) -> Pace:
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    config = merged(
        BankConfig(name="scaling", sensor=sensor),
        {
            "camera": {"width": 80, "height": 60, "samples_per_pixel": 2},
            "world": {"frames_per_clip": 4, "families": ["garage", "sunny_road"]},
            **{"seed": 5, "train_clips": 20, "validation_clips": 1, "test_clips": 1},
        },
    )
    # All of nearly the same cost, so that none makes the end of a turn longer.
    jobs = [job for job in clip_jobs(config, folder) if job.family == "garage"]
    jobs[0].folder.parent.mkdir(parents=True)
    return pace(render_missing, jobs, executor, 2, prepare=limit_threads)


def study(executor: Executor) -> dict[str, Any]:
    """Cells of pure arithmetic on one worker and on two, in turns."""
    cells = [_loops_of(CELL_S)] * CELLS
    # None is replaced at the end of a turn: to start another would take from the next.
    told = {"threads": 1, "tasks_per_worker": 2 * CELLS}
    turns = [
        [pace(_count, cells, executor, workers, **told) for workers in (1, 2)] for _ in range(TURNS)
    ]
    one, two = _middle(turns)
    note = (
        f"{TURNS} times {CELLS} cells: {1e3 * one.task_s:.0f} ms a cell with one worker, "
        f"{1e3 * two.task_s:.0f} ms with two; the first after {two.start_s:.1f} s"
    )
    ratio = one.task_s / (2 * two.task_s)
    return row(f"2 workers over twice 1, {executor}", ratio, ">=", STUDY_GOAL, note)


def overhead() -> dict[str, Any]:
    """Tasks without work, one after the other."""
    empty = [0] * EMPTY_TASKS
    local, ray = (
        pace(_count, empty, executor, 1, tasks_per_worker=EMPTY_TASKS) for executor in RUNNERS
    )
    note = f"mean of {EMPTY_TASKS} tasks one after the other; local {1e3 * local.task_s:.2f} ms"
    return row("milliseconds of an empty task, Ray", 1e3 * ray.task_s, "<=", OVERHEAD_GOAL_MS, note)


def _loops_of(seconds: float) -> int:
    """Rounds of `_count` that take so long."""
    tried = 2_000_000
    began = perf_counter()
    _count(tried)
    return round(tried * seconds / (perf_counter() - began))


def _count(loops: int) -> int:
    """Arithmetic that stays in the processor: no memory that two workers would share."""
    total = 0
    for number in range(loops):
        total += number & 3
    return total
