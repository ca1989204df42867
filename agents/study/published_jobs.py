"""Results of jobs on a place: which stand, what a job needs of others, and the study as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any, Final

from agents.study.jobs import Job
from agents.study.published_work import Shelf
from agents.training import CHECKPOINT
from unwrap.storage import (
    Place,
    place_to_publish,
    publish_contents,
    require_storable,
    standing_parts,
)
from unwrap.support import progress

STUDY: Final = "study"
RESULTS: Final = "results.json"


def fetch_results(url: str, jobs: Sequence[Job], folder: Path) -> None:
    """Fetch into `folder` the results of those of `jobs` that stand.

    Raises
    ------
    ValueError
        A job has a name that cannot be published.
    unwrap.storage.StorageError
        The place holds no study, cannot be read or written, or a result is damaged.
    """
    for job in jobs:
        require_storable(job.name)
    place = place_to_publish(url, STUDY)
    standing = standing_parts(place, STUDY)
    done = [job for job in jobs if job.name in standing]
    with progress(len(done), "fetching results", "job") as bar:
        for job in done:
            fetch_result(url, job, folder)
            bar.update(1)


def fetch_result(url: str, job: Job, folder: Path) -> None:
    """Fetch the result of a job that stands, without its scheduler and log."""
    result = (f"{job.name}.npz", f"{job.name}.json")
    Shelf(url, STUDY).fetch(job.name, folder, lambda path: path in result)


def fetch_scheduler(url: str, job: Job, folder: Path) -> None:
    """Fetch what another job needs of this one: its scheduler and its result."""
    Shelf(url, STUDY).fetch(job.name, folder, lambda path: Path(path).name != CHECKPOINT)


def training_kept(
    url: str, job: Job, depends_on: Mapping[str, Any], folder: Path
) -> AbstractContextManager[None]:
    """While a job trains, its training is resumed from the place, and kept there."""
    if job.kind != "learned" or job.source is not None:
        return nullcontext()
    return Shelf(url, STUDY).resumed(job.name, depends_on, folder / job.name)


def publish_result(url: str, job: Job, folder: Path) -> None:
    """Publish what a job has written: scheduler, log, arrays, and what says that it is done."""
    own = (f"{job.name}.", f"{job.name}/")

    def wanted(path: str) -> bool:
        # A checkpoint may have hundreds of MB, and what is done needs none.
        return path.startswith(own) and Path(path).name != CHECKPOINT

    Shelf(url, STUDY).publish(job.name, folder, wanted)


def publish_study(url: str, jobs: Sequence[Job], folder: Path) -> None:
    """Publish `results.json` of `folder`, and the table of contents of the whole study, last.

    Raises
    ------
    KeyError
        A job does not stand.
    unwrap.storage.StorageError
        The place holds something else, or cannot be written.
    """
    place = Place(url)
    standing = standing_parts(place, STUDY)
    publish_contents(place, STUDY, [standing[job.name] for job in jobs], folder, [RESULTS])
