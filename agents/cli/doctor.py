"""What is installed, what is missing, and the one command that mends it."""

from __future__ import annotations

import os
import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version

NEEDED_BYTES = 2 * 10**9
OLDEST_PYTHON = (3, 11)


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
    installed = (*_python(), *_packages())
    if not all(finding.well for finding in installed):
        return installed
    return (*installed, *_torch(), *_llvm(), *_cache(), *_weights())


def _python() -> tuple[Finding, ...]:
    well = sys.version_info[:2] >= OLDEST_PYTHON
    detail = f"{platform.python_version()} at {sys.executable}"
    return (Finding("python", well, detail, "apt-get install python3.11"),)


def _packages() -> tuple[Finding, ...]:
    """Every package that the main job imports, with its version."""
    names = sorted({_name_of(line) for line in requires("shotenv") or () if _is_for_main_job(line)})
    return tuple(_package(name) for name in names if name != "shotenv")


def _is_for_main_job(requirement: str) -> bool:
    return not any(f"extra == {quote}{e}{quote}" in requirement for quote in "'\"" for e in OTHERS)


OTHERS = ("all", "dev", "docs", "export", "fast", "verify")
"""Extras that the main job does without."""


def _name_of(requirement: str) -> str:
    return requirement.split(";")[0].split("[")[0].split("<")[0].split(">")[0].split("=")[0].strip()


def _package(name: str) -> Finding:
    try:
        return Finding(name, True, version(name))
    except PackageNotFoundError:
        return Finding(name, False, "not installed", "pip install 'shotenv[all]'")


def _torch() -> tuple[Finding, ...]:
    import torch

    device = "CUDA" if torch.cuda.is_available() else "CPU"
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    detail = f"{device} build, {torch.get_num_threads()} threads on {cores} cores"
    return (Finding("torch build", True, detail),)


def _llvm() -> tuple[Finding, ...]:
    from shotenv.render.backend import CURE, OLDEST_LLVM, find_llvm

    cure = CURE.removeprefix("install one with: ")
    found = find_llvm()
    if found is None:
        return (Finding("LLVM", False, "no library found", cure),)
    path, major = found
    detail = f"version {major} at {path}" if major else f"{path} is no LLVM library"
    return (Finding("LLVM", major >= OLDEST_LLVM, detail, cure),)


def _cache() -> tuple[Finding, ...]:
    from shotenv.bank import cache_dir

    folder = cache_dir()
    existing = next(path for path in (folder, *folder.parents) if path.is_dir())
    free = shutil.disk_usage(existing).free
    writable = os.access(existing, os.W_OK)
    detail = f"{folder}, {free / 1e9:.1f} GB free{'' if writable else ', not writable'}"
    cure = "export SHOTENV_CACHE=/a/folder/with/2/GB"
    return (Finding("cache folder", writable and free >= NEEDED_BYTES, detail, cure),)


def _weights() -> tuple[Finding, ...]:
    from unwrap.networks import load_unwrapper

    return tuple(_network(name, load_unwrapper) for name in ("tofregnet", "tofsegnet"))


def _network(name: str, load: Callable) -> Finding:
    try:
        unwrapper = load(name)
    except ValueError as error:
        return Finding(name, False, str(error), f"shotenv unwrap train --network {name}")
    width = unwrapper.metadata["width"]
    return Finding(name, True, f"width {width}, sha256 {unwrapper.fingerprint[:12]}")
