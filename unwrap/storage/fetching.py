"""From a place into a local folder: each file verified, resumable."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

from unwrap.storage.listing import Listing, StoredFile
from unwrap.storage.place import Place, StorageError
from unwrap.support import replacing


class DamagedError(StorageError):
    """A file on a place that is missing or has another digest than its listing tells."""


def fetch(
    place: Place,
    listing: Listing,
    folder: Path,
    *,
    tick: Callable[[int], object] = lambda _: None,
) -> None:
    """Fetch the files of `listing` into `folder`, in their order; what stands there is kept.

    A file goes into place whole, and only where its digest is that of the listing. Whoever calls
    this holds a lock where another process may do the same.

    Parameters
    ----------
    tick : callable
        Called with a number of bytes that stand.

    Raises
    ------
    StorageError
        A file is missing or damaged, the place cannot be read, or the disk has no room.
    """
    missing = [file for file in listing.files if not _stands(folder / file.path, file)]
    folder.mkdir(parents=True, exist_ok=True)
    needed, free = sum(file.bytes for file in missing), shutil.disk_usage(folder).free
    if needed > free:
        raise StorageError(
            f"{folder} needs {needed / 1e9:.2f} GB for what is at {place.url}, but the disk has "
            f"{free / 1e9:.2f} GB free; free space or choose another folder"
        )
    tick(listing.total_bytes - needed)
    for file in missing:
        _fetch_file(place, file, folder / file.path, tick)


def _stands(path: Path, file: StoredFile) -> bool:
    # Its digest was compared before it came to its name.
    return path.is_file() and path.stat().st_size == file.bytes


def _fetch_file(place: Place, file: StoredFile, path: Path, tick: Callable[[int], object]) -> None:
    # What a killed process left.
    for leftover in path.parent.glob(f".{path.name}.*"):
        leftover.unlink()
    with replacing(path) as target:
        for piece in _checked_pieces(place, file):
            target.write(piece)
            tick(len(piece))


def _checked_pieces(place: Place, file: StoredFile) -> Iterator[bytes]:
    """What is in a file, piece by piece; StorageError at the end where it was something else."""
    length, where = place.size(file.object_name), f"{place.url}/{file.object_name} ({file.path})"
    if length != file.bytes:
        found = "is missing" if length is None else f"has {length} bytes, expected {file.bytes}"
        raise DamagedError(f"{where} {found}; publish it again")
    digest = hashlib.sha256()
    for piece in place.pieces(file.object_name, file.bytes):
        digest.update(piece)
        yield piece
    if digest.hexdigest() != file.sha256:
        raise DamagedError(f"{where} has another SHA-256; delete it and publish it again")


def damaged_files(
    place: Place, listing: Listing, *, tick: Callable[[int], object] = lambda _: None
) -> tuple[StoredFile, ...]:
    """Files of `listing` that are missing there or have another digest; empty is good.

    Raises
    ------
    StorageError
        The place cannot be read.
    """
    damaged = []
    for file in listing.files:
        try:
            for piece in _checked_pieces(place, file):
                tick(len(piece))
        except DamagedError:
            damaged.append(file)
    return tuple(damaged)
