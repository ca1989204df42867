"""Processes that measurements start, kill and look at, and what lies in folders afterwards."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from reliability.rows import ROOT

SHOTENV = (sys.executable, "-m", "agents.cli")
"""The command line, as it stands here."""


def environment(cache: Path, **changes: str | None) -> dict[str, str]:
    """Variables of a process with a cache folder of its own; None takes one away."""
    told = {**os.environ, "PYTHONPATH": str(ROOT), "SHOTENV_CACHE": str(cache), **changes}
    return {name: value for name, value in told.items() if value is not None}


def started(words: Sequence[object], variables: Mapping[str, str], log: Path) -> subprocess.Popen:
    """A process that leads a group of its own, whose output goes to the end of `log`."""
    with log.open("a") as file:
        return subprocess.Popen(
            [str(word) for word in words],
            env=dict(variables),
            stdout=file,
            stderr=file,
            start_new_session=True,
        )


def group(leader: int) -> list[int]:
    """Living processes of the group of `leader`."""
    found = []
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            status = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:  # It has just ended.
            continue
        if int(status[2]) == leader and status[0] != "Z":
            found.append(int(entry.name))
    return found


def wait_for(condition: Callable[[], bool], seconds: float) -> float:
    """How long it took until `condition` held; infinite where it did not within `seconds`."""
    begun = time.monotonic()
    while time.monotonic() - begun < seconds:
        if condition():
            return time.monotonic() - begun
        time.sleep(0.02)
    return float("inf")


def orphans_after(leader: int, seconds: float) -> list[int]:
    """Processes of the group that are there `seconds` after its leader has ended; then killed."""
    wait_for(lambda: not group(leader), seconds)
    left = group(leader)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    return left


def digests(folder: Path, left_out: Callable[[str], bool] = lambda name: False) -> dict[str, str]:
    """SHA-256 of every file below `folder` by its path there, hidden ones as well."""
    return {
        name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and not left_out(name := path.relative_to(folder).as_posix())
    }


def memory_mb(pid: int | str = "self") -> float:
    """Resident memory of a process, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    (line,) = (line for line in lines if line.startswith("VmRSS:"))
    return int(line.split()[1]) * 1024 / 1e6


def descriptors(pid: int | str = "self") -> int:
    """Files that a process has open."""
    return sum(1 for _ in Path(f"/proc/{pid}/fd").iterdir())
