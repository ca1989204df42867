"""Any surroundings work, or one sentence says what to do; nothing ends in a traceback.

Each case is a command or a short program in a process of its own: a full disk (as far as files may
grow, `RLIMIT_FSIZE`, and a small file system where this runs as root), a cache that cannot be
written, odd paths, no home folder, orders of imports, ways to start processes, one core, no LLVM.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import permutations
from pathlib import Path

from reliability.processes import SHOTENV, environment
from reliability.rows import Progress, Row
from reliability.small import tiny_problem, write_small_bank_config

LIMIT_S = 300
PLAY = """
import gymnasium, shotenv
env = gymnasium.make("shotenv/ShotSchedule-v0", frames_per_drive=8)
env.reset(seed=0)
for _ in range(8):
    _, reward, *_ = env.step(1)
print(repr(float(reward)))
"""
RENDER = """
from shotenv.render.backend.llvm import start_mitsuba
print(start_mitsuba().variant())
"""
STARTED = """
import multiprocessing
import gymnasium, shotenv

def make():
    return gymnasium.make("shotenv/ShotSchedule-v0", frames_per_drive=8)

if __name__ == "__main__":
    envs = gymnasium.vector.AsyncVectorEnv([make, make], context={method!r})
    envs.reset(seed=0)
    for _ in range(9):
        envs.step([1, 1])
    envs.close()
    print("played")
"""
IMPORTS = ("torch", "mitsuba", "numba", "stable_baselines3", "shotenv")
ODD = ("with spaces", "Umläute-日本", "line\nbreak", "-dash", "x" * 200, "quo'te\"s", "a[b]*?")


@dataclass(frozen=True)
class Case:
    """A process and what it meets.

    Attributes
    ----------
    works : bool
        Whether it is to do its work, or to say in one sentence what is the matter.
    says : str
        What is in that sentence.
    """

    name: str
    words: Sequence[object]
    works: bool = True
    says: str = ""
    variables: dict[str, str | None] = field(default_factory=dict)
    before: Callable[[], None] | None = None
    folder: Path | None = None


def faults_of(case: Case, cache: Path) -> str:
    """What is wrong with how a case ends; nothing where all is well."""
    try:
        done = subprocess.run(
            [str(word) for word in case.words],
            env=environment(cache, **case.variables),
            cwd=case.folder,
            preexec_fn=case.before,
            capture_output=True,
            text=True,
            timeout=LIMIT_S,
        )
    except subprocess.TimeoutExpired:
        return f"hangs for {LIMIT_S} s"
    told = done.stderr.strip()
    if "Traceback" in told:
        return f"ends in a traceback: {told.splitlines()[-1][:200]}"
    if case.works:
        return "" if done.returncode == 0 else f"status {done.returncode}: {told[-300:]}"
    if done.returncode != 1 or case.says not in told:
        return f"status {done.returncode}, without {case.says!r}: {told[-300:]}"
    return ""


def small_files() -> None:
    """As if the disk were full: writing beyond 20 kB fails, with a signal that is ignored."""
    import signal

    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


def one_core() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def of_disks(place: Path) -> list[Case]:
    """A full disk for each command that writes, and a cache that cannot be written."""
    small, tiny = write_small_bank_config(place), tiny_problem(place)
    env = [f"--env.{name}={value}" for name, value in {**tiny, "frames_per_drive": 16}.items()]
    few = ["--agent.regression.rounds=1", "--agent.regression.drives=2", "--study.tuning_drives=2"]
    train = [*SHOTENV, "train", *env, "--agent", "configs/agent/regression.yaml", *few]
    blocked = place / "blocked"
    blocked.write_text("a file where a folder is to be")
    render, network = [*SHOTENV, "render", "--config", small], [*SHOTENV, "unwrap", "train"]
    told = [f"--bank={tiny['bank']}", "--width=4", "--epochs=1", "--batch_size=2"]
    full = {"works": False, "says": "File too large", "before": small_files}
    return [
        # NumPy says how much it could not write, and not why.
        Case(
            "full disk: render",
            [*render, "--out", place / "f1"],
            **{**full, "says": "requested and"},
        ),  # type: ignore[arg-type]
        Case(
            "full disk: train",
            [*train, "--out", place / "f2"],
            **{**full, "says": "distance_m.npy: "},
        ),  # type: ignore[arg-type]
        Case("full disk: unwrap train", [*network, *told, "--out", place / "f3"], **full),  # type: ignore[arg-type]
        Case(
            "cache that cannot be written: play",
            [sys.executable, "-c", PLAY],
            variables={"SHOTENV_CACHE": str(blocked / "cache")},
        ),
        Case(
            "cache that cannot be written: render",
            render,
            works=False,
            says="SHOTENV_CACHE",
            variables={"SHOTENV_CACHE": str(blocked / "cache")},
        ),
        Case(
            "no home folder: play",
            [sys.executable, "-c", PLAY],
            variables={"HOME": "/nonexistent", "SHOTENV_CACHE": None, "XDG_CACHE_HOME": None},
        ),
    ]


def of_paths(place: Path) -> list[Case]:
    """Recordings of drives into folders of odd names, given as absolute and as relative paths."""
    tiny = {**tiny_problem(place), "frames_per_drive": 4}
    words = [*SHOTENV, "record", "--camera", "mlx75027", "--drives", 1]
    words += [f"--{name}={value}" for name, value in tiny.items()]
    cases = []
    for number, name in enumerate(ODD):
        cases.append(Case(f"odd path: {name[:20]!r}", [*words, f"--out={place / 'odd' / name}"]))
        own = place / f"own{number}"
        own.mkdir()
        relative = [*words, f"--out={name}"]
        cases.append(Case(f"odd path, relative: {name[:20]!r}", relative, folder=own))
    return cases


def of_processes(place: Path, orders: int) -> list[Case]:
    """Orders of imports, ways to start processes, cores, and libraries of LLVM."""
    python = [sys.executable, "-c"]
    cases = [
        Case(
            f"imports: {', '.join(order)}", [*python, f"import {', '.join(order)}\n{PLAY}{RENDER}"]
        )
        for order in list(permutations(IMPORTS))[:: max(1, 120 // orders)]
    ]
    for method in ("spawn", "forkserver"):
        script = place / f"{method}.py"
        script.write_text(STARTED.format(method=method))
        cases.append(Case(f"AsyncVectorEnv by {method}", [sys.executable, script]))
    small = write_small_bank_config(place, train_clips=1, validation_clips=0, test_clips=0)
    render = [*SHOTENV, "render", "--config", small, "--out"]
    no_library = place / "libLLVM-15.so"
    no_library.write_bytes(b"\x7fELF of nothing")
    cases.append(Case("one core: render", [*render, place / "one"], before=one_core))
    for name, path in (("missing", place / "none.so"), ("a file that is none", no_library)):
        llvm = {"DRJIT_LIBLLVM_PATH": str(path)}
        out = place / f"llvm{len(cases)}"
        told = "cannot be loaded as an LLVM library"
        cases.append(Case(f"LLVM: {name}", [*render, out], False, told, llvm))
    return cases


def of_cases(name: str, cases: list[Case], cache: Path, progress: Progress) -> Row:
    begun, faults = time.perf_counter(), []
    for case in cases:
        found = faults_of(case, cache)
        progress(f"{case.name}: {found or 'as promised'}")
        if found:
            faults.append(f"{case.name} {found}")
    return Row(
        11,
        f"{name}: {len(cases)} cases",
        {"as promised": len(cases) - len(faults), "not": faults or "none"},
        not faults,
        time.perf_counter() - begun,
    )


def measure(progress: Progress) -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        kinds = {
            "full disk, unwritable cache, no home folder": of_disks(place),
            "odd paths": of_paths(place),
            "imports, spawn and forkserver, one core, LLVM": of_processes(
                place, progress.size(24, 2)
            ),
        }
        return [
            progress.row(11, name, partial(of_cases, name, cases, place / "cache", progress))
            for name, cases in kinds.items()
        ]
