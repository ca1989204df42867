"""Any surroundings work, or one sentence says what to do; nothing ends in a traceback.

Each case is a command or a short program in a process of its own: a full disk (a small file system
where this runs as root, else a limit to the size of files, `RLIMIT_FSIZE`), a cache that cannot be
written, odd paths, no home folder, orders of imports, ways to start processes, one core, no LLVM.
"""

from __future__ import annotations

import errno
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import permutations
from pathlib import Path
from typing import Any

from reliability.processes import SHOTENV, environment
from reliability.rows import ROOT, Progress, Row
from reliability.small import small_recordings, study_files, tiny_problem, write_small_bank_config

LIMIT_S = 300
FULL = r"is the disk full\?|but the disk has .* free"
"""What NumPy's words are made to end with, and what is said before a bank is begun."""
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
LIBRARIES = Path("/usr/lib")
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
        Pattern of what is in that sentence.
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
    if done.returncode != 1 or not re.search(case.says, told):
        return f"status {done.returncode}, without {case.says!r}: {told[-300:]}"
    return ""


@contextmanager
def full_disk(place: Path) -> Iterator[dict[str, Any]]:
    """What of a `Case` makes its disk full, which is at `place`.

    A file system of 64 kB where this may be mounted, as root may; else no file grows beyond 20 kB,
    which is another error of the same kind.
    """
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(place)]
    try:
        mounted = subprocess.run(mount, capture_output=True).returncode == 0
    except OSError:
        mounted = False
    if not mounted:
        yield {"says": f"{os.strerror(errno.EFBIG)}|{FULL}", "before": small_files}
        return
    try:
        yield {"says": f"{os.strerror(errno.ENOSPC)}|{FULL}"}
    finally:
        subprocess.run(["umount", "--lazy", str(place)], check=True)


def small_files() -> None:
    """Writing beyond 20 kB fails, with a signal that is ignored."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))


def one_core() -> None:
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})


def of_full_disks(place: Path, full: dict[str, Any]) -> list[Case]:
    """A full disk, at `place / "full"`, for each command that writes."""
    small, tiny = write_small_bank_config(place), tiny_problem(place)
    env = [f"--env.{name}={value}" for name, value in {**tiny, "frames_per_drive": 16}.items()]
    few = ["--agent.regression.rounds=1", "--agent.regression.drives=2", "--study.tuning_drives=2"]
    told = [f"--bank={tiny['bank']}", "--width=4", "--epochs=1", "--batch_size=2"]
    recordings = small_recordings(place, 2)
    commands: dict[str, list[object]] = {
        "render": ["--config", small],
        "train": [*env, "--agent", ROOT / "configs/agent/regression.yaml", *few],
        "unwrap train": told,
        "study": [study_files(place)],
        "bank import": [
            *(recordings, "--camera", "mlx75027", "--sensor", recordings / "sensor.yaml")
        ],
        "record": ["--camera", "mlx75027", *(f"--{name}={value}" for name, value in tiny.items())],
    }
    return [
        Case(
            f"full disk: {name}",
            [*SHOTENV, *name.split(), *words, "--out", place / "full" / str(number)],
            works=False,
            variables={"SHOTENV_CACHE": str(place / "full" / f"cache{number}")},
            **full,
        )
        for number, (name, words) in enumerate(commands.items())
    ]


def of_folders(place: Path) -> list[Case]:
    """A cache that cannot be written, and no home folder."""
    blocked = place / "blocked"
    blocked.write_text("a file where a folder is to be")
    render = [*SHOTENV, "render", "--config", write_small_bank_config(place)]
    return [
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
    unusable = "cannot be loaded as an LLVM library"
    libraries = [
        ("missing", place / "none.so", unusable),
        ("a file that is none", no_library, unusable),
        # Where this machine has one: Debian's `libllvm15`.
        *(("15", path, "is LLVM 15") for path in sorted(LIBRARIES.glob("*/libLLVM-15.so.1"))[:1]),
    ]
    for name, path, told in libraries:
        out, llvm = place / f"llvm{len(cases)}", {"DRJIT_LIBLLVM_PATH": str(path)}
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
    with tempfile.TemporaryDirectory() as folder, full_disk(Path(folder) / "full") as full:
        place = Path(folder)
        how = "files of at most 20 kB" if "before" in full else "a file system of 64 kB"
        kinds = {
            f"full disk, {how}": of_full_disks(place, full),
            "unwritable cache, no home folder": of_folders(place),
            "odd paths": of_paths(place),
            "imports, spawn and forkserver, one core, LLVM": of_processes(
                place, progress.size(24, 2)
            ),
        }
        return [
            progress.row(11, name, partial(of_cases, name, cases, place / "cache", progress))
            for name, cases in kinds.items()
        ]
