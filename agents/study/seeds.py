"""The same training with several seeds, each a task for a worker."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from agents.config import DemoConfig
from agents.training import train_scheduler
from unwrap.execution import Executor, output_to, run_tasks, visible
from unwrap.support import progress


class SeedTask(NamedTuple):
    """One training; its scheduler goes to the folder `out`."""

    config: DemoConfig
    out: Path


def train_seeds(
    config: DemoConfig,
    seeds: Sequence[int],
    out: Path,
    *,
    executor: Executor = "local",
    workers: int | None = None,
) -> list[Path]:
    """Train with each seed, into a folder of its own in `out`; those that stand are kept.

    Parameters
    ----------
    executor, workers
        See `run_tasks`. With "ray" all machines must see `out`.

    Returns
    -------
    list of Path
        The folders `seed-<seed>`, in the order of `seeds`; beside each its log.

    Raises
    ------
    ValueError
        A seed comes twice; or trainings failed, after all others were run.
    """
    if len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds are {', '.join(map(str, seeds))}; expected each once")
    out = out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    tasks = [
        SeedTask(
            config.model_copy(update={"agent": config.agent.model_copy(update={"seed": seed})}),
            out / f"seed-{seed}",
        )
        for seed in seeds
    ]
    failed = []
    with progress(len(tasks), "trainings", "seed") as bar:
        for _, error in run_tasks(
            train_seed,
            tasks,
            executor=executor,
            workers=workers,
            # Drives are made of small maps, which gain nothing from more.
            threads=1,
            name=lambda task: task.out.name,
            keep_going=True,
        ):
            failed += [str(error)] if error is not None else []
            bar.update(1)
    if failed:
        raise ValueError(
            f"{len(failed)} of {len(tasks)} seeds failed, the others are kept: {'; '.join(failed)}"
        )
    return [task.out for task in tasks]


def train_seed(task: SeedTask) -> None:
    """Train with one seed; bars and lines go to a file beside its folder."""
    visible(task.out.parent)
    with output_to(task.out.with_suffix(".log")):
        train_scheduler(task.config, task.out)
