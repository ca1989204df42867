"""Jobs run in workers, one thread each; those that stand are not run again."""

from __future__ import annotations

import tempfile
import time
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from agents.config import DemoConfig
from agents.evaluation import (
    PlayedFront,
    check_study,
    drive_seeds,
    make_envs,
    play_blind,
    play_front,
    price_of,
    prices_of,
    table_fronts,
    tune_families,
)
from agents.policies import RandomPolicy, Scheduler, load_policy
from agents.study.job_results import JobResult, beside, stands, write_result
from agents.study.jobs import REFERENCES, Job
from agents.study.published_jobs import (
    fetch_result,
    fetch_results,
    fetch_scheduler,
    publish_result,
    training_kept,
)
from agents.training import train_scheduler
from shotenv.config import EnvConfig
from shotenv.decision import open_problem
from unwrap.execution import Executor, output_to, run_tasks, visible, wait_for_file
from unwrap.support import progress, say

JOBS_PER_WORKER = 1000
"""Jobs after which a process is replaced by a new one: they leave nothing behind, but who knows."""


class JobTask(NamedTuple):
    """One job for a worker, which writes its result below `folder`, or publishes it at `url`."""

    job: Job
    folder: Path
    depends_on: dict[str, Any]
    url: str | None = None
    executor: Executor = "local"


def run_jobs(
    jobs: Sequence[Job],
    folder: Path,
    *,
    url: str | None = None,
    workers: int | None = None,
    executor: Executor = "local",
) -> None:
    """Run what does not stand yet in `folder`.

    Parameters
    ----------
    url : str, optional
        Place where results stand and are published; `folder`, an empty one, becomes a copy of
        them, without schedulers and logs.
    workers : int, optional
        Jobs at a time; one per core by default.
    executor : "local" or "ray"
        With "ray", on machines that all see `folder`, unless there is an `url`, and the banks.

    Raises
    ------
    ValueError
        Results of another schema or configuration are there, before anything is run; or jobs
        failed, after all others were run; or a job's name cannot be published.
    unwrap.storage.StorageError
        The place holds something else, cannot be read, or a result there is damaged.
    KeyboardInterrupt
        Ctrl-C; what was finished is kept, and the message says how much.
    """
    folder = folder.resolve()
    folder.mkdir(parents=True, exist_ok=True)
    if url is not None:
        fetch_results(url, jobs, folder)
    # Renders and predicts, too, what several processes would else do at the same time.
    banks = banks_of(jobs)
    left = [
        JobTask(job, folder, told, url, executor)
        for job in jobs
        if not stands(folder / job.name, told := job.depends_on(banks))
    ]
    order = _Order(left)
    failed: list[str] = []
    with progress(len(jobs), "study", "job", done=len(jobs) - len(left)) as bar:
        try:
            # With no name of its own: whatever leaves the loop ends the workers at once.
            for task, error in run_tasks(
                run_job,
                order.tasks(),
                executor=executor,
                workers=workers,
                # Drives are made of small maps, which gain nothing from more.
                threads=1,
                tasks_per_worker=JOBS_PER_WORKER,
                name=lambda task: task.job.name,
                keep_going=True,
            ):
                if error is not None:
                    failed.append(str(error))
                    say(f"{error}; the others go on")  # Now, and not hours later.
                elif url is not None:
                    fetch_result(url, task.job, folder)
                else:
                    wait_for_file(beside(folder / task.job.name, ".json"), executor)
                order.release(task)
                bar.update(1)
        except KeyboardInterrupt:
            kept = sum(folder.joinpath(f"{job.name}.json").is_file() for job in jobs)
            raise KeyboardInterrupt(
                f"{kept} of {len(jobs)} jobs are kept; the same command continues"
            ) from None
    if failed:
        raise ValueError(
            f"{len(failed)} of {len(jobs)} jobs failed, the others are kept: {'; '.join(failed)}"
        )


class _Order:
    """What is played elsewhere comes after what trains it, and all else in its order."""

    def __init__(self, tasks: Sequence[JobTask]) -> None:
        names = {task.job.name for task in tasks}
        self._left = len(tasks)
        self._ready: deque[JobTask] = deque()
        self._held: dict[str, list[JobTask]] = {}
        for task in tasks:
            source = task.job.source
            if source is not None and source.name in names:
                self._held.setdefault(source.name, []).append(task)
            else:
                self._ready.append(task)

    def tasks(self) -> Iterator[JobTask | None]:
        """All of them; None while those that are left wait for others."""
        while self._left:
            if self._ready:
                self._left -= 1
                yield self._ready.popleft()
            else:
                yield None

    def release(self, finished: JobTask) -> None:
        """What waits for this one can begin; where it failed, that is told by each of them."""
        self._ready.extend(self._held.pop(finished.job.name, ()))


def banks_of(jobs: Sequence[Job]) -> dict[str, str]:
    """Fingerprint of the bank of each table, and of those of the jobs' sources."""
    both = (one for job in jobs for one in (job, job.source) if one is not None)
    tables = {job.table: job.config.env for job in both}
    return {table: bank_of(env) for table, env in tables.items()}


def bank_of(config: EnvConfig) -> str:
    """Fingerprint of the bank, which is rendered and predicted where it does not stand yet."""
    return open_problem(config.model_copy(update={"split": "all"})).bank.fingerprint


def run_job(task: JobTask) -> None:
    """Run one job; its bars and lines go to a file beside its result.

    Where there is a place, in a folder that is deleted once all of it is published.
    """
    if task.url is not None:
        with tempfile.TemporaryDirectory() as scratch:
            here = JobTask(task.job, Path(scratch), task.depends_on)
            if task.job.source is not None:
                fetch_scheduler(task.url, task.job.source, here.folder)
            with training_kept(task.url, task.job, task.depends_on, here.folder):
                run_job(here)
            publish_result(task.url, task.job, here.folder)
        return
    began, (job, folder, depends_on) = time.process_time(), task[:3]
    stem = visible(folder) / job.name
    if job.source is not None:
        wait_for_file(beside(folder / job.source.name, ".json"), task.executor)
    stem.parent.mkdir(parents=True, exist_ok=True)
    with output_to(beside(stem, ".log")):
        config, arrays = job.config, {}
        if job.kind == REFERENCES:
            study = config.study
            envs = make_envs(config.env, study.split, study.drives, "Disabled")
            fronts = {"blind": play_blind(envs, drive_seeds(study, study.drives))}
            problem = open_problem(config.env.model_copy(update={"split": study.split}))
            optimum, arrays["cool_eight_m"] = table_fronts(problem, study)
            fronts |= {"optimum": optimum} if optimum else {}
        else:
            fronts = {"front": front_of_job(job, folder, depends_on)}
    write_result(stem, JobResult(fronts, time.process_time() - began, arrays), depends_on)


def front_of_job(job: Job, folder: Path, depends_on: dict[str, Any]) -> PlayedFront:
    """Train or tune, unless another job does, and play at every price of the study and at that of
    the preset."""
    config, price = job.config, price_of(job.config.env)
    prices = tuple(sorted({*config.study.prices, price}))
    if job.kind in ("learned", "saved"):
        return _front_of_scheduler(config, _scheduler(job, folder, depends_on), price)
    if job.kind == "random":
        policy = RandomPolicy(job.seed)
        return _played(config, lambda price: policy, prices)
    # Cheap enough to be done again for each place: the same drives give the same rule.
    tuning = job.source.config if job.source else config
    study = tuning.study.model_copy(update={"families": (job.policy,), "prices": prices})
    (tuned,) = tune_families(tuning.model_copy(update={"study": study})).values()
    return _played(config, lambda price: tuned[price].policy, prices)


def _scheduler(job: Job, folder: Path, depends_on: dict[str, Any]) -> Scheduler:
    """The scheduler that a job plays: a saved one, that of its source, or its own.

    Raises
    ------
    ValueError
        The source has no result.
    """
    if job.folder is not None:
        return load_policy(job.folder)
    if job.source is None:
        # Training resumes in this folder where it was interrupted.
        return train_scheduler(job.config, folder / job.name)
    # A training that was cut off has left a scheduler, too, but no result.
    if not stands(folder / job.source.name, depends_on["source"]):
        raise ValueError(f"{job.source.name}, which trains its scheduler, has no result")
    return load_policy(folder / job.source.name)


def _front_of_scheduler(config: DemoConfig, scheduler: Scheduler, price: float) -> PlayedFront:
    check_study(config, scheduler)
    # Also where the preset's price is not among those of its training: it is what the reward asks.
    own = tuple(sorted({*prices_of(scheduler, config.study.prices), price}))
    return _played(config, lambda price: scheduler, own)


def _played(config: DemoConfig, at_price: Any, prices: Sequence[float]) -> PlayedFront:
    study = config.study
    envs = make_envs(config.env, study.split, study.drives, "Disabled")
    # Of a rule its words; a network has none.
    return play_front(
        at_price,
        envs,
        drive_seeds(study, study.drives),
        prices,
        names=lambda policy: "scheduler" if isinstance(policy, Scheduler) else str(policy),
    )
