"""Work whose files go to a place: done in a folder of its own machine, then published whole.

parts/<label>/<name>.json               a job or a training that is done, see `unwrap.storage`
unfinished/<label>/<name>-<digest>.zip  what a training has come to, by what it depends on, until
                                        it is done
"""

from __future__ import annotations

import hashlib
import json
import re
import tempfile
import threading
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from agents.training import CHECKPOINT, VALIDATION
from unwrap.storage import (
    Listing,
    Place,
    StorageError,
    fetch,
    find_part,
    publish_part,
    require_storable,
)
from unwrap.support import in_one_line, say

KEPT_EVERY_S: Final = 300.0
"""So often is looked for a new checkpoint: that much is lost at most with a machine (assumed)."""
MOST_FILES, MOST_BYTES = 100, 2**33
"""Of what a training has come to."""
ARCHIVE_END, TAIL = b"PK\5\6", 22 + 2**16
"""What the record at the end of a ZIP archive begins with, and the bytes that it takes at most."""


class Shelf(NamedTuple):
    """Where on a place work of one kind is published.

    Attributes
    ----------
    url : str
    label : str
        The kind; see `unwrap.storage`.
    """

    url: str
    label: str

    @property
    def place(self) -> Place:
        """Opened anew, as each process needs it."""
        return Place(self.url)

    def fetch(self, name: str, folder: Path, wanted: Callable[[str], bool]) -> Listing | None:
        """Fetch those files of the work `name` that are wanted, by path; None: it is not done.

        Raises
        ------
        unwrap.storage.StorageError
            The place cannot be read, or a file is damaged; the message names it.
        """
        listing = find_part(self.place, self.label, name)
        if listing is not None:
            files = tuple(file for file in listing.files if wanted(file.path))
            fetch(self.place, listing.model_copy(update={"files": files}), folder)
        return listing

    def publish(self, name: str, folder: Path, wanted: Callable[[str], bool]) -> Listing:
        """Publish those files in `folder` that are wanted, `name`.json last where there is one.

        Then what the work had come to before its end is deleted.
        """
        paths = (path for path in folder.rglob("*") if path.is_file())
        names = [path.relative_to(folder).as_posix() for path in paths]
        own = sorted(filter(wanted, names), key=lambda path: (path == f"{name}.json", path))
        place = self.place
        listing = publish_part(place, self.label, name, folder, own)
        archives = re.compile(re.escape(self._unfinished(name)) + r"-[0-9a-f]{16}\.zip")
        with suppress(StorageError):  # What is published, is; this only takes room.
            for there in place.sizes(self._unfinished(name).rpartition("/")[0]):
                if archives.fullmatch(there):
                    place.discard(there)
        return listing

    def _unfinished(self, name: str) -> str:
        return f"unfinished/{self.label}/{name}"

    @contextmanager
    def resumed(self, name: str, depends_on: Mapping[str, Any], folder: Path) -> Iterator[None]:
        """Put into `folder` what such a training has come to, and publish it now and then.

        A place that cannot be written meanwhile ends no training.
        """
        known = json.dumps(depends_on, sort_keys=True).encode()
        there = f"{self._unfinished(name)}-{hashlib.sha256(known).hexdigest()[:16]}.zip"
        with tempfile.TemporaryDirectory() as scratch:
            archive, ended = Path(scratch) / "unfinished.zip", threading.Event()
            self._unpack(there, archive, folder)
            begun = _changed_at(folder)

            def keep() -> None:
                kept = begun
                while not ended.wait(KEPT_EVERY_S):
                    if (now := _changed_at(folder)) != kept:
                        try:
                            _pack(folder, archive)
                            self.place.upload(there, archive)
                            kept = now
                        except OSError as error:
                            say(f"{error}; training goes on")

            thread = threading.Thread(target=keep, daemon=True)
            thread.start()
            try:
                yield
            finally:
                ended.set()
                thread.join()

    def _unpack(self, there: str, archive: Path, folder: Path) -> None:
        place = self.place
        size = place.size(there)
        if size is None or size > MOST_BYTES:
            return
        # Before gigabytes are fetched.
        is_archive = ARCHIVE_END in b"".join(place.pieces(there, size, start=max(0, size - TAIL)))
        if is_archive:
            with archive.open("wb") as file:
                file.writelines(place.pieces(there, size))
        try:
            if not is_archive:
                raise ValueError("no archive")
            _check_archive(archive)
        # The last where it leads to places before its beginning.
        except (zipfile.BadZipFile, zlib.error, ValueError, RuntimeError, EOFError, OSError) as e:
            raise StorageError(
                f"{place.url}/{there} is damaged ({in_one_line(e)}); delete it to train anew"
            ) from None
        folder.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(archive) as packed:
            packed.extractall(folder)


def _check_archive(archive: Path) -> None:
    """Refuse what `_pack` does not write."""
    with zipfile.ZipFile(archive) as packed:
        members = packed.infolist()
        if len(members) > MOST_FILES or sum(one.file_size for one in members) > MOST_BYTES:
            raise ValueError(f"expected at most {MOST_FILES} files and {MOST_BYTES} bytes")
        for one in members:
            require_storable(one.filename)
            if "/" in one.filename:
                raise ValueError(f"{one.filename} lies in a folder; expected files alone")
        if (name := packed.testzip()) is not None:
            raise ValueError(f"{name} is not as it was written")


def _changed_at(folder: Path) -> int | None:
    """When the checkpoint was written, None before the first."""
    path = folder / CHECKPOINT
    return path.stat().st_mtime_ns if path.is_file() else None


def _pack(folder: Path, archive: Path) -> None:
    """Checkpoint and best policy: what is written between the two, training writes again."""
    # What comes last, where a training is at its end, would tell of a policy not packed yet.
    left_out = (CHECKPOINT, VALIDATION)
    others = sorted(
        path
        for path in folder.iterdir()
        if path.is_file() and path.name not in left_out and not path.name.startswith(".")
    )
    with zipfile.ZipFile(archive, "w") as packed:
        for path in (folder / CHECKPOINT, *others):
            packed.write(path, path.name)
