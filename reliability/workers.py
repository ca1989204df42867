"""A dead, stopped or raising worker is named within 10 s, and nothing is left running.

Workers of rendering, of a study and of the training of a network on two devices are killed or
stopped from outside while the command is at work; one that raises is a user's environment in
Gymnasium's AsyncVectorEnv, and a source of frames that a network is trained on. AsyncVectorEnv
itself waits for ever where it is not given a `timeout`.
"""

from __future__ import annotations

import os
import re
import signal
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import gymnasium

import shotenv  # noqa: F401 - registers the environments
from reliability.processes import SHOTENV, environment, group, orphans_after, started, wait_for
from reliability.rows import Progress, Row
from reliability.small import study_files, tiny_problem, write_small_bank_config
from unwrap.training.data import AcquiredAhead, in_order

LIMIT_S = 10.0
STARTS_S = 300.0
"""Within which a command has workers that are at work."""
TIMEOUT_S = 5.0
"""What AsyncVectorEnv is told to wait for a step."""


class FailingSource:
    """Frames of which one cannot be had."""

    def __len__(self) -> int:
        return 40

    def batch(self, numbers: list[int], *, draw: int, shots: object) -> object:
        if 20 in numbers:
            raise ValueError("clips/00020/active.npy is damaged")
        return numbers


class FailingEnv(gymnasium.Wrapper):
    """Raises in its third step."""

    def __init__(self, env: gymnasium.Env) -> None:
        super().__init__(env)
        self._steps = 0

    def step(self, action):
        self._steps += 1
        if self._steps == 3:
            raise ValueError("frame 3 is damaged")
        return super().step(action)


def plain_env() -> gymnasium.Env:
    return gymnasium.make("shotenv/ShotSchedule-v0", frames_per_drive=64)


def failing_env() -> gymnasium.Env:
    return FailingEnv(plain_env())


def workers_of(leader: int) -> list[int]:
    """Worker processes of a command: spawned, and past their imports."""
    found = []
    for pid in group(leader):
        try:
            words = Path(f"/proc/{pid}/cmdline").read_bytes()
            ready = len(list(Path(f"/proc/{pid}/task").iterdir())) > 1
        except OSError:
            continue
        if b"spawn_main" in words and ready:
            found.append(pid)
    return found


@dataclass(frozen=True)
class Command:
    """What has workers.

    Attributes
    ----------
    name : str
    words : list
        Without the folder it writes.
    at_work : callable
        Whether its workers are at a task and not only at their imports, from its folder.
    naming : str
        Pattern of what it says of a lost worker, besides its process number; by default of nothing.
    """

    name: str
    words: list[object]
    at_work: Callable[[Path], bool] = lambda out: True
    naming: str = "(?!)"


def of_command(command: Command, how: signal.Signals, place: Path) -> Row:
    """One of the workers of a command is killed or stopped from outside."""
    begun = time.perf_counter()
    name = f"{command.name} {how.name}".replace(" ", "-")
    log, out = place / f"{name}.txt", place / name
    variables = environment(place / "cache", OMP_NUM_THREADS="1")
    process = started([*SHOTENV, *command.words, "--out", out], variables, log)

    def named() -> str | None:
        lines = re.split(r"[\r\n]+", log.read_text())
        saying = re.compile(rf"\b{victim}\b|{command.naming}")
        return next((line for line in lines if saying.search(line)), None)

    try:
        begins_s = wait_for(
            lambda: len(workers_of(process.pid)) > 1 and command.at_work(out), STARTS_S
        )
        if begins_s > STARTS_S:
            raise RuntimeError(f"{command.name} has no workers:\n{log.read_text()[-2000:]}")
        time.sleep(2.0)
        victim = workers_of(process.pid)[0]
        os.kill(victim, how)
        # A study goes on with its other jobs: it is named while they run, and ended here.
        named_s = wait_for(lambda: named() is not None, 60.0)
        wait_for(lambda: process.poll() is not None, 2.0)
    finally:
        process.kill()
        process.wait()
        orphans = orphans_after(process.pid, LIMIT_S)
    return Row(
        10,
        f"`shotenv {command.name}`: a worker gets {how.name}",
        {
            "named after, s": round(named_s, 1) if named_s < 60 else "never",
            "processes left": len(orphans),
            # Without the progress bar before it, and without folders.
            "said": re.sub(r"^.*(?=shotenv: )|\S*/", "", named() or "nothing")[:160],
        },
        named_s <= LIMIT_S and not orphans and "Traceback" not in log.read_text(),
        time.perf_counter() - begun,
    )


def of_vector(name: str, makes: list[Callable[[], gymnasium.Env]], how: int | None) -> Row:
    """An environment of an AsyncVectorEnv fails; or its process is killed or stopped."""
    begun = time.perf_counter()
    envs = gymnasium.vector.AsyncVectorEnv(makes, context="spawn")
    envs.reset(seed=0)
    before = envs.processes[1].pid
    if how is not None:
        os.kill(before, how)
    asked, error = time.monotonic(), "nothing"
    try:
        for _ in range(3):
            envs.step_async([0] * len(makes))
            envs.step_wait(timeout=TIMEOUT_S)
    except Exception as raised:
        error = f"{type(raised).__name__}: {raised}".splitlines()[0]
    named_s = time.monotonic() - asked
    pids = [process.pid for process in envs.processes]
    for process in envs.processes:
        # A stopped one does not see that it is asked to end: `close(terminate=True)` would wait.
        process.kill()
        process.join(1.0)
    # Nor does `close` cope with pipes whose ends are gone; that of one that raised is closed.
    for pipe in filter(None, envs.parent_pipes):
        pipe.close()
    envs.closed = True
    left = [pid for pid in pids if Path(f"/proc/{pid}").exists()]
    return Row(
        10,
        f"AsyncVectorEnv with `timeout={TIMEOUT_S:g}`: {name}",
        {
            "raised after, s": round(named_s, 1),
            "said": error[:160],
            "processes left": len(left),
        },
        named_s <= LIMIT_S and error != "nothing" and not left,
        time.perf_counter() - begun,
    )


def of_threads() -> Row:
    """A frame that a thread is to acquire for a training cannot be had."""
    begun, error = time.perf_counter(), "nothing"
    before = set(threading.enumerate())
    source = FailingSource()
    batches = AcquiredAhead(source, in_order(source, 2, (), draw=0), 2)  # type: ignore[arg-type]
    try:
        for _ in batches:
            pass
    except ValueError as raised:
        error = str(raised)
    seconds = time.perf_counter() - begun
    left = [one for one in threading.enumerate() if one not in before and one.is_alive()]
    wait_for(lambda: not any(one.is_alive() for one in left), LIMIT_S)
    living = sum(one.is_alive() for one in left)
    return Row(
        10,
        "threads that acquire frames for a training: one raises",
        {"raised after, s": round(seconds, 2), "said": error, "threads left": living},
        seconds <= LIMIT_S and "active.npy" in error and not living,
        seconds,
    )


def commands(place: Path) -> list[Command]:
    """Long enough that workers are at work when they are hit."""
    small = write_small_bank_config(place, train_clips=200)
    study = study_files(place, seeds=list(range(40)))
    network = {"width": 4, "epochs": 10_000, "batch_size": 4, "devices": 2}
    train = [f"--{name}={value}" for name, value in network.items()]
    bank = tiny_problem(place)["bank"]
    return [
        Command("render", ["render", "--config", small, "--workers", 2]),
        Command("study", ["study", study, "--workers", 2]),
        Command(
            "unwrap train --devices 2",
            ["unwrap", "train", "--bank", bank, *train],
            lambda out: (out / "tofregnet.ckpt").is_file(),
            r"process \d of 2 (failed|hangs)",
        ),
    ]


def measure(progress: Progress) -> list[Row]:
    rows = [progress.row(10, "threads", of_threads)]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for command in commands(place):
            for how in (signal.SIGKILL, signal.SIGSTOP):
                name = f"{command.name}, {how.name}"
                rows.append(progress.row(10, name, partial(of_command, command, how, place)))
        for what, makes, signalled in (
            ("one raises", [plain_env, failing_env], None),
            ("one gets SIGKILL", [plain_env, plain_env], signal.SIGKILL),
            ("one gets SIGSTOP", [plain_env, plain_env], signal.SIGSTOP),
        ):
            make = partial(of_vector, what, makes, signalled)
            rows.append(progress.row(10, f"AsyncVectorEnv, {what}", make))
    return rows
