"""Which folder a bank lies in, and which configuration a folder was rendered from."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from shotenv.bank.files.layout import BankError
from shotenv.config import ACQUISITION_FIELDS, BankConfig
from unwrap.support import in_one_line, read_json, say

RENDERING_VERSION = 4
"""Raised when the same configuration would give other light: old banks are then left alone."""

SOURCE = "source.json"
"""File in a bank's folder with the `identity` it is rendered from, written before any clip."""

LOCK = ".lock"
"""File in a folder that one process at a time writes."""
SILENT_S = 1.0
"""After so long whoever waits for another process is told."""

SHIPPED = Path(__file__).parents[2] / "data"
"""Folder of the banks that come with the package."""


def cache_dir() -> Path:
    """Folder of rendered banks and kept predictions: SHOTENV_CACHE, or the user's cache folder."""
    import platformdirs

    return Path(os.environ.get("SHOTENV_CACHE") or platformdirs.user_cache_path("shotenv"))


def fetched_banks() -> Path:
    """Folder of the banks that were fetched from places (`s3://...`)."""
    return cache_dir() / "fetched"


def bank_folder(config: BankConfig) -> Path:
    """Where the bank of `config` lies; a bank of another `identity` lies elsewhere.

    Examples
    --------
    >>> bank_folder(starter).name                                       # doctest: +SKIP
    'starter-5ea61398'
    """
    content = json.dumps(identity(config), sort_keys=True)
    return cache_dir() / "banks" / f"{config.name}-{sha256(content.encode()).hexdigest()[:8]}"


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """While no other process writes the bank in `folder`; waits for one that does, and says so."""
    lock = FileLock(folder / LOCK)
    try:
        lock.acquire(timeout=SILENT_S)
    except Timeout:
        say(f"another process writes {folder}; waiting for it")
        lock.acquire()
    try:
        yield
    finally:
        lock.release()


def identity(config: BankConfig) -> dict[str, Any]:
    """Everything that the bank's content depends on, as JSON: all but `ACQUISITION_FIELDS`.

    A scene of one's own counts by the digest of what is in its files, wherever they lie.
    """
    unrelated = {"sensor": set(ACQUISITION_FIELDS), "own_scene": {"file", "most_faces"}}
    content = config.model_dump(mode="json", exclude=unrelated)
    # Not named where it is as it was before there was a choice: those banks stay what they are.
    if config.storage == "float32":
        del content["storage"]
    return {"rendering_version": RENDERING_VERSION, "config": content}


def was_rendered_from(folder: Path, config: BankConfig) -> bool:
    """Whether the bank in `folder`, finished or not, is that of `config`.

    Raises
    ------
    BankError
        What tells it is damaged; names the file and the cure.
    """
    path = folder / SOURCE
    if not os.path.lexists(path):
        return False
    try:
        return read_json(path) == identity(config)
    except (OSError, ValueError) as error:
        raise BankError(
            f"{path} is damaged ({in_one_line(error)}); delete {folder} and render the bank again, "
            "or choose another folder"
        ) from None
