"""Properties hold for thousands of examples: decoding, merging, unwrapping, intervals, fronts.

The files `tests/**/test_*_properties.py`, with 10,000 examples of each property where CI has 60.
About a quarter of an hour on one core (estimated, not measured).
"""

from __future__ import annotations

import re
import subprocess
import sys
import time
from functools import partial

from reliability.rows import ROOT, Progress, Row


def measure(progress: Progress) -> list[Row]:
    """A row for each file of properties."""
    profile, examples = ("everyday", 60) if progress.quick else ("long", 10_000)

    def of(name: str) -> Row:
        begun = time.perf_counter()
        command = [sys.executable, "-m", "pytest", "-n0", "-q", "--timeout=0"]
        command += [f"--hypothesis-profile={profile}", name]
        told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        counts = {what: int(count) for count, what in re.findall(r"(\d+) (\w+)", last_line(told))}
        found = {"properties that hold": counts.get("passed", 0), "broken": counts.get("failed", 0)}
        if told.returncode:
            progress(told.stdout)
        seconds = time.perf_counter() - begun
        done = f"up to {examples} drawn examples of each property in `{name}`"
        return Row(5, done, found, told.returncode == 0, seconds)

    paths = sorted((ROOT / "tests").rglob("test_*_properties.py"))
    names = [str(path.relative_to(ROOT)) for path in paths]
    return [progress.row(5, name, partial(of, name)) for name in names]


def last_line(told: subprocess.CompletedProcess[str]) -> str:
    """How many tests passed and failed, as pytest says it in the end."""
    return told.stdout.strip().rpartition("\n")[2]
