"""The command that says what is installed, what is missing, and the one command that mends it."""

from __future__ import annotations

import os
import platform
import re
import shutil
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version

from jsonargparse import Namespace

from agents.cli.command import DONE, FAILED, Command, add_json, write_numbers

NEEDED_BYTES = 2 * 10**9  # assumed: the starter bank, its predictions and a run, with room to spare
OLDEST_PYTHON = (3, 11)
MAIN_JOB = ("render", "unwrap", "agents")
"""Extras that the main job needs, `shotenv demo`."""


@dataclass(frozen=True)
class Finding:
    """One thing looked at: whether it is well, what was found, and what mends it."""

    name: str
    well: bool
    detail: str
    cure: str = ""

    def __str__(self) -> str:
        """One line, or two where there is something to mend."""
        line = f"{'ok' if self.well else 'MISSING':8}{self.name:22}{self.detail}"
        return line if self.well else f"{line}\n{'':8}mend it with: {self.cure}"


def examine() -> tuple[Finding, ...]:
    """Look at everything that the main job needs; stops at packages where one is missing."""
    installed = (python_itself(), *packages())
    if not all(finding.well for finding in installed):
        # What follows imports them.
        return installed
    return (*installed, torch_build(), llvm(), cache_folder(), *shipped_networks())


def python_itself() -> Finding:
    """Whether this Python is new enough."""
    well = sys.version_info[:2] >= OLDEST_PYTHON
    detail = f"{platform.python_version()} at {sys.executable}"
    return Finding("python", well, detail, "apt-get install python3.11")


def packages() -> tuple[Finding, ...]:
    """Every package that the main job imports, with its version."""
    # A requirement reads `mitsuba<4,>=3.7; extra == "render"`: name, versions, and what it is for.
    names = set()
    for line in requires("shotenv") or ():
        extra = re.search(r"""extra == ['"](\w+)['"]""", line)
        if extra is None or extra.group(1) in MAIN_JOB:
            names.add(re.split(r"[;\[<>=!~ ]", line)[0])
    found = []
    for name in sorted(names):
        try:
            found.append(Finding(name, True, version(name)))
        except PackageNotFoundError:
            found.append(Finding(name, False, "not installed", "pip install 'shotenv[all]'"))
    return tuple(found)


def torch_build() -> Finding:
    """Which torch, and how much of the machine it may use."""
    import torch

    device = "CUDA" if torch.cuda.is_available() else "CPU"
    # Of the cores those that this process may use, which a container or `taskset` limits; not every
    # system can tell.
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    detail = f"{device} build, {torch.get_num_threads()} threads on {cores} cores"
    return Finding("torch build", True, detail)


def llvm() -> Finding:
    """Whether the renderer finds the library that it compiles with."""
    from shotenv.render.backend import CURE, OLDEST_LLVM, find_llvm

    cure = CURE.removeprefix("install one with: ")
    found = find_llvm()
    if found is None:
        return Finding("LLVM", False, "no library found", cure)
    path, major = found
    detail = f"version {major} at {path}" if major else f"{path} is no LLVM library"
    return Finding("LLVM", major >= OLDEST_LLVM, detail, cure)


def cache_folder() -> Finding:
    """Whether there is room for a bank."""
    from shotenv.bank import cache_dir

    folder = cache_dir()
    # Made at the first bank: until then the nearest folder that exists tells.
    existing = next(path for path in (folder, *folder.parents) if path.is_dir())
    free = shutil.disk_usage(existing).free
    writable = os.access(existing, os.W_OK)
    detail = f"{folder}, {free / 1e9:.1f} GB free{'' if writable else ', not writable'}"
    cure = "export SHOTENV_CACHE=/a/folder/with/2/GB"
    return Finding("cache folder", writable and free >= NEEDED_BYTES, detail, cure)


def shipped_networks() -> tuple[Finding, ...]:
    """Whether the weights of the two networks of the paper can be read."""
    from unwrap.networks import load_unwrapper

    found = []
    for name in ("tofregnet", "tofsegnet"):
        try:
            unwrapper = load_unwrapper(name)
        except ValueError as error:
            cure = f"shotenv unwrap train --network {name}"
            found.append(Finding(name, False, str(error), cure))
        else:
            detail = f"width {unwrapper.metadata['width']}, sha256 {unwrapper.fingerprint[:12]}"
            found.append(Finding(name, True, detail))
    return tuple(found)


def tell_findings(arguments: Namespace) -> int:
    """Say what is installed and what is missing; fails where something is."""
    findings = examine()
    for finding in findings:
        print(finding)
    write_numbers(arguments, [vars(finding) for finding in findings])
    return DONE if all(finding.well for finding in findings) else FAILED


COMMANDS = (
    Command(
        "doctor",
        "say what is installed, what is missing and what mends it",
        add_json,
        tell_findings,
    ),
)
