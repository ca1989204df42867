"""What a measurement reports, and how it is kept: a JSON file each, with where it was measured."""

from __future__ import annotations

import json
import os
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "docs" / "reliability"
"""Folder of the files of measurements."""


@dataclass(frozen=True)
class Row:
    """One line of the page.

    Parameters
    ----------
    promise : int
        Number of the promise in `reliability.page.PROMISES`.
    done : str
        What was done, with how often.
    found : mapping
        What was measured, by what it is, with its unit: `{"growth, MB": 1.2}`.
    holds : bool
        Whether that is what is promised.
    seconds : float
        What it took.
    """

    promise: int
    done: str
    found: Mapping[str, Any]
    holds: bool
    seconds: float


UNMEASURED = "could not be measured"
"""What is found where a part of a measurement raises."""


@dataclass(frozen=True)
class Progress:
    """Tells how far a measurement is, how much it is to do, and keeps the parts that are done.

    Parameters
    ----------
    quick : bool
        A trial: each `size` is the second of its arguments. What it finds is not kept.
    say : callable, optional
        Where a line goes; by default it is printed at once.
    parts : Path, optional
        File of the parts that are done, with a line of JSON each; without one none is kept.
    before_s : list of float
        What each part took that was done before.
    """

    quick: bool = False
    say: Callable[[str], None] = lambda words: print(words, flush=True)
    parts: Path | None = None
    before_s: list[float] = field(default_factory=list)

    def __call__(self, words: str) -> None:
        self.say(f"  {words}")

    def size(self, whole: int, trial: int) -> int:
        """How often or how long: as promised, or for a trial."""
        return trial if self.quick else whole

    def part(self, name: str, make: Callable[[], Any]) -> Any:
        """What `make` gives, as JSON has it; of an interrupted measurement, what it gave then."""
        for kept_name, value, seconds in self._kept():
            if kept_name == name:
                self(f"{name}: done before")
                self.before_s.append(seconds)
                return value
        begun = time.perf_counter()
        value = make()
        seconds = time.perf_counter() - begun
        if self.parts is not None:
            self.parts.parent.mkdir(exist_ok=True)
            with self.parts.open("a", encoding="utf-8") as file:
                # On a line of its own, whatever a killed process has left of its last.
                file.write("\n" + json.dumps([name, value, seconds]))
        return value

    def row(self, promise: int, name: str, make: Callable[[], Row]) -> Row:
        """A row as a part; where `make` raises, a row that says so, and the others go on."""
        begun = time.perf_counter()
        try:
            row = Row(**self.part(name, lambda: asdict(make())))
        except Exception as error:
            traceback.print_exc()
            found = {UNMEASURED: f"{type(error).__name__}: {error}"[:300]}
            row = Row(promise, name, found, False, time.perf_counter() - begun)
        self(str(row))
        return row

    def _kept(self) -> list[tuple[str, Any, float]]:
        if self.parts is None or not self.parts.is_file():
            return []
        found = []
        for line in self.parts.read_text(encoding="utf-8").splitlines():
            with suppress(ValueError):  # The last line of a process that was killed.
                name, value, seconds = json.loads(line)
                found.append((name, value, seconds))
        return found


def machine() -> dict[str, str | int]:
    """Processor and the cores of it that this process may use."""
    lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "processor": names[0] if names else os.uname().machine,
        "cores": len(os.sched_getaffinity(0)),
    }


def file_of(name: str) -> Path:
    """Where the rows of a measurement are kept."""
    return KEPT / f"{name}.json"


def parts_of(name: str) -> Path:
    """Where the parts of a measurement are kept until all of them are done."""
    return file_of(name).with_suffix(".parts")


def keep(name: str, rows: list[Row], seconds: float) -> None:
    """Write the rows of a measurement, beside first: an interrupted one leaves the former."""
    told = {
        "command": f"python -m reliability {name}",
        "machine": machine(),
        "date": time.strftime("%Y-%m-%d", time.gmtime()),
        "seconds": round(seconds, 1),
        "rows": [asdict(row) for row in rows],
    }
    KEPT.mkdir(exist_ok=True)
    beside = file_of(name).with_suffix(".part")
    beside.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    beside.replace(file_of(name))
    if not any(UNMEASURED in row.found for row in rows):
        parts_of(name).unlink(missing_ok=True)


def kept(name: str) -> dict[str, Any]:
    """What `keep` has written: command, machine, date, seconds and rows."""
    told: dict[str, Any] = json.loads(file_of(name).read_text(encoding="utf-8"))
    return {**told, "rows": [Row(**row) for row in told["rows"]]}
