"""The same training with several seeds, each a task for a worker."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

from agents.config import DemoConfig
from agents.study.published_work import Shelf
from agents.training import train_scheduler
from shotenv.config import merged
from unwrap.execution import Executor, output_to, run_tasks, visible
from unwrap.storage import Place, place_to_publish, publish_contents, standing_parts
from unwrap.support import progress

TRAININGS: Final = "trainings"


class SeedTask(NamedTuple):
    """One training; its scheduler goes to the folder `out`, or to one of its name at `url`."""

    config: DemoConfig
    out: Path
    url: str | None = None


def train_seeds(
    config: DemoConfig,
    seeds: Sequence[int],
    out: Path | str,
    *,
    executor: Executor = "local",
    workers: int | None = None,
) -> list[Path] | list[str]:
    """Train with each seed, into a folder of its own in `out`; those that stand are kept.

    Parameters
    ----------
    out : Path or str
        A folder, or the URL of a place.
    executor, workers
        See `run_tasks`. With "ray" all machines must see `out`, where it is a folder.

    Returns
    -------
    list of Path, or of str
        The folders `seed-<seed>`, in the order of `seeds`; beside each its log.

    Raises
    ------
    ValueError
        A seed comes twice, or cannot be `agent.seed`; or trainings failed, after all others were
        run.
    unwrap.storage.StorageError
        The place holds something else, or cannot be read or written.
    """
    if len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds are {', '.join(map(str, seeds))}; expected each once")
    agents = [merged(config.agent, {"seed": seed}) for seed in seeds]
    url, folder = (out, Path()) if isinstance(out, str) else (None, out.resolve())
    if url is None:
        folder.mkdir(parents=True, exist_ok=True)
    else:
        place_to_publish(url, TRAININGS)
    tasks = [
        SeedTask(config.model_copy(update={"agent": agent}), folder / f"seed-{agent.seed}", url)
        for agent in agents
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
    if url is None:
        return [task.out for task in tasks]
    place = Place(url)
    publish_contents(place, TRAININGS, standing_parts(place, TRAININGS).values(), folder, [])
    return [f"{place.url}/{task.out.name}" for task in tasks]


def train_seed(task: SeedTask) -> None:
    """Train with one seed; bars and lines go to a file beside its folder."""
    if task.url is not None:
        _train_to_place(Shelf(task.url, TRAININGS), task)
        return
    visible(task.out.parent)
    with output_to(task.out.with_suffix(".log")):
        train_scheduler(task.config, task.out)


def _train_to_place(shelf: Shelf, task: SeedTask) -> None:
    """The same in a folder that is deleted once all of it is published."""
    name, told = task.out.name, task.config.model_dump(mode="json")
    with tempfile.TemporaryDirectory() as scratch:
        here = SeedTask(task.config, Path(scratch) / name)
        if shelf.fetch(name, here.out.parent, lambda path: True) is not None:
            train_seed(here)  # At its end; or of another configuration, which this tells.
            return
        with shelf.resumed(name, told, here.out):
            train_seed(here)
        shelf.publish(name, here.out.parent, lambda path: True)
