"""Nothing that is read, however damaged or hostile, runs code, hangs or ends in a traceback.

Each kind of file is made as it should be, read once, and then changed a thousand times (a hundred
where reading takes seconds): truncated,
flipped, swollen, promised to be huge, pickled, replaced by a pipe, a folder, a device or another
file, filled with values of other kinds, with zip and alias bombs, with names that lead out of the
folder. Each is read as a command would, in a process with limited memory. What is refused must be a
ValueError or an OSError whose message names the file; what can be read may be taken.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import resource
import shutil
import tempfile
import time
import warnings
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path

import psutil
import torch

from reliability.hostile_kinds import KINDS, Kind
from reliability.mutations import mutate
from reliability.rows import Progress, Row

LONGEST_S, LONGEST_WAIT_S, FIRST_S = 10.0, 60.0, 120.0
"""Of a read: seconds of the processor, some hundred times what it takes; seconds of waiting, on a
machine that others use; and what imports come before."""
MOST_BYTES = 1 << 31
"""Of memory beyond that which the process has before its first read."""
SEED = 20


@dataclass
class Tally:
    """What became of the changed files of one kind."""

    kind: str
    taken: int = 0
    refused: int = 0
    executions: int = 0
    hangs: list[str] = field(default_factory=list)
    crashes: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)
    nameless: list[str] = field(default_factory=list)
    growth_mb: float = 0.0

    @property
    def faults(self) -> list[str]:
        """What must not be, in words."""
        found = [f"{self.executions} executions"] if self.executions else []
        for what in ("hangs", "crashes", "others", "nameless"):
            found += [f"{what}: {one}" for one in getattr(self, what)]
        return found


def measure(progress: Progress) -> list[Row]:
    """A thousand changes of each kind of file, a hundred of those that take seconds to read."""
    count, rows = progress.size(1000, 20), []
    begun = time.perf_counter()
    tallies = []
    for kind in KINDS:
        tallies.append(_kept(kind, round(kind.share * count), progress))
        progress(f"{kind.name}: {len(tallies[-1].faults)} faults, {tallies[-1].refused} refused")
        for fault in tallies[-1].faults[:5]:
            progress(f"  {fault[:300]}")
    found = {
        "kinds": len(KINDS),
        "files": sum(one.taken + one.refused + len(one.hangs) for one in tallies),
        "refused": sum(one.refused for one in tallies),
        "executions": sum(one.executions for one in tallies),
        "hangs": sum(len(one.hangs) for one in tallies),
        "ended processes": sum(len(one.crashes) for one in tallies),
        "errors of other types": sum(len(one.others) for one in tallies),
        "messages without the file": sum(len(one.nameless) for one in tallies),
        "most memory of a kind, MB": round(max(one.growth_mb for one in tallies)),
    }
    rows.append(
        Row(
            7,
            f"{count} changes of each of {len(KINDS)} kinds of files read; a tenth of the "
            f"{sum(kind.share < 1 for kind in KINDS)} that take seconds to read",
            found,
            not any(one.faults for one in tallies),
            time.perf_counter() - begun + sum(progress.before_s),
        )
    )
    return rows


def _kept(kind: Kind, count: int, progress: Progress) -> Tally:
    return Tally(**progress.part(kind.name, lambda: asdict(tallied(kind, count))))


def tallied(kind: Kind, count: int, seed: int = SEED) -> Tally:
    """What becomes of `count` changed files of a kind."""
    tally, done = Tally(kind.name), 0
    with tempfile.TemporaryDirectory(prefix="hostile-") as name:
        folder = Path(name)
        good = folder / "good"
        good.mkdir()
        relative = kind.make(good).relative_to(good)
        while done < count:
            done = _in_a_process(kind, good, relative, range(done, count), seed, folder, tally)
        tally.executions = len(list(folder.glob("canary*")))
    return tally


def _in_a_process(
    kind: Kind, good: Path, relative: Path, numbers: range, seed: int, folder: Path, tally: Tally
) -> int:
    """Read the changed files of `numbers` until one ends the process; returns the next number."""
    # Forked: what a reader imports is loaded once per kind, not once per process that has ended.
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe()
    worker = context.Process(
        target=_read_all, args=(theirs, kind, good, relative, numbers, seed, folder), daemon=True
    )
    worker.start()
    theirs.close()
    next_number, way = numbers.start, "the sound file"
    try:
        while next_number < numbers.stop:
            # The first answer comes after the imports.
            first = way == "the sound file"
            if not (ours.poll(FIRST_S) if first else _answers(ours, worker)):
                tally.hangs.append(f"{next_number} {way}")
                next_number += 1
                break
            what, told = ours.recv()
            if what == "begins":
                way = told
                continue
            next_number += 1
            if what == "taken":
                tally.taken += 1
            else:
                tally.refused += 1
                if what != "refused":
                    getattr(tally, what).append(f"{next_number - 1} {way}: {told}")
            tally.growth_mb = max(tally.growth_mb, ours.recv())
    except EOFError:
        worker.join()
        tally.crashes.append(f"{next_number} {way}: exit status {worker.exitcode}")
        next_number += 1
    finally:
        worker.kill()
        worker.join()
        ours.close()
    return next_number


def _answers(pipe: Connection, worker: BaseProcess) -> bool:
    """Whether something comes before the worker has computed, or waited, for too long."""
    process = psutil.Process(worker.pid)
    begun_s, before_s = time.monotonic(), sum(process.cpu_times()[:2])
    while time.monotonic() - begun_s < LONGEST_WAIT_S:
        if pipe.poll(1.0):
            return True
        if sum(process.cpu_times()[:2]) - before_s > LONGEST_S:
            return False
    return False


def _read_all(
    pipe: Connection,
    kind: Kind,
    good: Path,
    relative: Path,
    numbers: range,
    seed: int,
    folder: Path,
) -> None:
    """In the worker: change a copy of the sound file, read it, tell what happened."""
    warnings.simplefilter("ignore")
    _quiet()
    # The process that this one was forked from may have used torch's threads, which are not here.
    torch.set_num_threads(1)
    copy = folder / f"copy{os.getpid()}"
    shutil.copytree(good, copy)
    kind.read(copy / relative)
    before = _peak_mb()
    _limit_memory()
    for number in numbers:
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(good, copy)
        # By kind and number: a single fault can be seen again without the others.
        way = mutate(
            copy / relative,
            random.Random(f"{seed} {kind.name} {number}"),
            folder / f"canary{number}",
        )
        pipe.send(("begins", way))
        pipe.send(_outcome(kind, copy / relative))
        pipe.send(_peak_mb() - before)


def _outcome(kind: Kind, path: Path) -> tuple[str, str]:
    try:
        kind.read(path)
    except (ValueError, OSError) as error:
        # A folder counts where it is what was asked for.
        names = (path.name, path.parent.name, path.stem)
        named = any(name in str(error) for name in names)
        return ("refused", "") if named else ("nameless", f"{type(error).__name__}: {error}")
    except BaseException as error:
        return "others", f"{type(error).__name__}: {str(error)[:200]}"
    return "taken", ""


def _peak_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def _limit_memory() -> None:
    pages = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0])
    most = pages * os.sysconf("SC_PAGE_SIZE") + MOST_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _quiet() -> None:
    """Readers, and what they stand on, print to nowhere."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
