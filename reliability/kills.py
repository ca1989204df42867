"""Killed at random moments and started again, a run leaves the same bytes as one left alone.

`kill -9` of the command itself, at a moment of the last four fifths of the time that it takes when
it is left alone (the first is imports). It is started again until it ends, and killed again until
each kind of run has had its kills; then every file is compared, hidden ones as well, in the folder
of the run and beside it. What may differ are logs: `*.log`, TensorBoard's, what Lightning writes
beside the weights for itself, and how many seconds a job took.
"""

from __future__ import annotations

import hashlib
import os
import random
import re
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from reliability.processes import SHOTENV, digests, environment, orphans_after, started
from reliability.rows import Progress, Row
from reliability.small import small_recordings, study_files, tiny_problem, write_small_bank_config

HANGS = 20
"""As many times longer than it takes, and a run that nobody kills any more has failed."""
ENDS_S = 10.0
"""Within which workers have ended after their parent."""
LEARNERS = {
    "ppo": "--agent.ppo.total_steps 512 --agent.ppo.num_envs 4 --agent.ppo.rollout_steps 16"
    " --agent.ppo.batch_size 16 --agent.ppo.drives 2",
    "recurrent_ppo": "--agent.ppo.total_steps 512 --agent.ppo.num_envs 4"
    " --agent.ppo.rollout_steps 16 --agent.ppo.batch_size 16 --agent.ppo.drives 2"
    " --agent.recurrent.units 4",
    "dqn": "--agent.dqn.total_steps 1024 --agent.dqn.num_envs 2 --agent.dqn.learning_starts 16"
    " --agent.dqn.validations 16",
    "qrdqn": "--agent.dqn.total_steps 1024 --agent.dqn.num_envs 2 --agent.dqn.learning_starts 16"
    " --agent.dqn.validations 16",
    "regression": "--agent.regression.rounds 6 --agent.regression.drives 8"
    " --agent.regression.validation_drives 4 --agent.regression.passes 2",
}


@dataclass(frozen=True)
class Run:
    """A command that is killed.

    Attributes
    ----------
    words : callable
        Of the command, from the folder it writes.
    kills : int
    may_differ : str
        Pattern of paths that are not compared.
    """

    name: str
    words: Callable[[Path], list[object]]
    kills: int
    may_differ: str = r"(^|/)(\.lock|.*\.log)$"


@dataclass
class Tally:
    """What the kills of one kind of run came to."""

    kills: int = 0
    ends: int = 0
    different: list[str] = field(default_factory=list)
    orphans: int = 0
    failed: list[str] = field(default_factory=list)


def runs(place: Path, progress: Progress) -> list[Run]:
    """A hundred kills in all."""
    small, tiny = write_small_bank_config(place), tiny_problem(place)
    recordings, study = small_recordings(place), study_files(place)
    env = [f"--env.{name}={value}" for name, value in {**tiny, "frames_per_drive": 16}.items()]
    train = [*SHOTENV, "train", *env, "--study.tuning_drives=2"]
    network = {"bank": tiny["bank"], "width": 4, "epochs": 12, "batch_size": 2, "stride": 1}
    return [
        Run(
            "rendering (`shotenv render`, 2 workers)",
            lambda out: [*SHOTENV, "render", "--config", small, "--workers", 2, "--out", out],
            progress.size(20, 1),
        ),
        Run(
            "training of a network (`shotenv unwrap train`)",
            lambda out: [
                *(*SHOTENV, "unwrap", "train", "--out", out),
                *(f"--{name}={value}" for name, value in network.items()),
            ],
            progress.size(20, 1),
            # What a resumed training writes of its own course, and the time of its saving.
            r"(^|/)(tensorboard/.*|.*\.ckpt)$",
        ),
        *(
            Run(
                f"training of a scheduler by {name} (`shotenv train`)",
                lambda out, name=name, told=told: [  # type: ignore[misc]
                    *(*train, "--agent", f"configs/agent/{name}.yaml", *told.split()),
                    *("--out", out),
                ],
                progress.size(4, 1),
            )
            for name, told in LEARNERS.items()
        ),
        Run(
            "a study (`shotenv study`, 2 workers)",
            lambda out: [*SHOTENV, "study", study, "--workers", 2, "--out", out],
            progress.size(20, 1),
        ),
        Run(
            "import of recordings (`shotenv bank import`)",
            lambda out: [
                *(*SHOTENV, "bank", "import", recordings, "--camera", "mlx75027"),
                *("--sensor", recordings / "sensor.yaml", "--out", out),
            ],
            progress.size(20, 1),
        ),
    ]


def left_by(parent: Path, run: Run) -> dict[str, str]:
    """Digest of every file that is compared, with the folder's own name and seconds taken out."""
    skipped = re.compile(run.may_differ)
    found = digests(parent, lambda name: skipped.search(name) is not None)
    for name in found:
        if name.endswith((".json", ".yaml")):
            text = (parent / name).read_text(encoding="utf-8").replace(str(parent), "")
            text = re.sub(r'"(seconds|training_minutes)": [\d.]+', "", text)
            found[name] = hashlib.sha256(text.encode()).hexdigest()
    return found


def whole(run: Run, parent: Path, variables: dict[str, str]) -> tuple[dict[str, str], float]:
    """What a run that is left alone leaves in `parent`, and its seconds."""
    parent.mkdir()
    begun, log = time.monotonic(), parent.with_suffix(".txt")
    process = started(run.words(parent / "out"), variables, log)
    if process.wait() != 0:
        raise RuntimeError(f"{run.name} fails when it is left alone:\n{log.read_text()[-2000:]}")
    return left_by(parent, run), time.monotonic() - begun


def killed(run: Run, place: Path, variables: dict[str, str], seed: int) -> Tally:
    """Kill one kind of run as often as it is to be, in as many folders as it takes."""
    # Once before, for what others find in the cache: machine code, predictions.
    whole(run, place / "before", variables)
    expected, seconds = whole(run, place / "whole", variables)
    tally, moment = Tally(), random.Random(seed)
    while tally.kills < run.kills:
        parent = place / f"killed{tally.ends}"
        parent.mkdir()
        log, status = parent.with_suffix(".txt"), None
        while status is None:
            process = started(run.words(parent / "out"), variables, log)
            last = tally.kills >= run.kills
            limit_s = HANGS * seconds if last else moment.uniform(0.2, 1.0) * seconds
            try:
                status = process.wait(limit_s)
            except subprocess.TimeoutExpired:
                os.kill(process.pid, signal.SIGKILL)
                killed_by = process.wait()
                if last:  # It hangs.
                    status = killed_by
                else:
                    tally.kills += 1
            tally.orphans += len(orphans_after(process.pid, ENDS_S))
        tally.ends += 1
        if status != 0:
            tally.failed.append(log.read_text()[-500:])
        found = left_by(parent, run)
        tally.different += sorted(
            name for name in found.keys() | expected if found.get(name) != expected.get(name)
        )
        shutil.rmtree(parent)
    return tally


def of_run(run: Run, own: Path, variables: dict[str, str], seed: int) -> Row:
    begun = time.perf_counter()
    own.mkdir()
    tally = killed(run, own, variables, seed)
    shutil.rmtree(own)
    faults = {
        "files that differ": len(tally.different),
        "ended with an error": len(tally.failed),
        "processes left": tally.orphans,
    }
    told = {"which": sorted(set(tally.different))[:10]} if tally.different else {}
    return Row(
        8,
        f"{run.name}, killed {tally.kills} times",
        {"runs that came to their end": tally.ends, **faults, **told},
        not any(faults.values()),
        time.perf_counter() - begun,
    )


def measure(progress: Progress) -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        variables = environment(place / "cache", OMP_NUM_THREADS="1")
        return [
            progress.row(
                8, run.name, partial(of_run, run, place / f"run{number}", variables, number)
            )
            for number, run in enumerate(runs(place, progress))
        ]
