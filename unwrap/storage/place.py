"""A folder at a URL, through fsspec: a bucket, a shared disk, a folder of this machine."""

from __future__ import annotations

import re
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from unwrap.support import in_one_line, replacing

URL = re.compile(r"[A-Za-z][A-Za-z0-9+.:-]*://")
PASSWORD = re.compile(r"://[^/]*:.*@|://[^/].*[?]")
"""A URL with what may be one, also where it has a slash; or in what is asked of a server."""
PIECE_BYTES = 2**24
"""A large file is read in pieces of so many."""


class StorageError(OSError):
    """A place that cannot be read or written, or what lies there is damaged; names URL and cure."""


def is_url(text: object) -> bool:
    """Whether it is the URL of a place (`s3://bucket/folder`), and no name or path.

    Examples
    --------
    >>> is_url("s3://bucket/banks/wide"), is_url("/banks/wide"), is_url("wide")
    (True, False, False)
    """
    return isinstance(text, str) and URL.match(text) is not None


class Place:
    """A folder at a URL; names of its files have `/` between their parts.

    Parameters
    ----------
    url
        Of a bucket or a folder, by any such protocol that fsspec knows: `s3://bucket/bank`,
        `file:///shared/bank`. Keys and passwords are taken from where the backend of that protocol
        looks for them.

    Raises
    ------
    StorageError
        fsspec or the backend is not installed, there is no such protocol, or the URL has a password
        in it or is made of several.

    Examples
    --------
    >>> place = Place("memory://shelf")
    >>> place.write("a/note.txt", b"hello")
    >>> place.sizes("a"), place.read("a/note.txt", most_bytes=100)
    ({'a/note.txt': 5}, b'hello')
    """

    def __init__(self, url: str) -> None:
        require_plain(url)
        self.url = url.rstrip("/")
        self._files, root = _opened(self.url)
        self._root = root.rstrip("/")
        self._is_local = "file" in _protocols(self._files)

    def __repr__(self) -> str:
        return f"Place({self.url!r})"

    def read(self, name: str, *, most_bytes: int) -> bytes | None:
        """Content of a file, None where there is none.

        Raises
        ------
        StorageError
            It has more than `most_bytes`, or cannot be read.
        """
        size = self.size(name)
        if size is None:
            return None
        if size > most_bytes:
            raise StorageError(
                f"{self._shown(name)} has {size} bytes; expected at most {most_bytes}"
            )
        return b"".join(self.pieces(name, size))

    def read_all(self, names: Iterable[str]) -> dict[str, bytes]:
        """Contents of several small files by name; backends that can read them side by side."""
        paths = {self._path(name): name for name in names}
        if not paths:
            return {}
        with self._telling("read", ""):
            found = self._files.cat(list(paths))
        return {paths[path]: content for path, content in found.items()}

    def pieces(self, name: str, size: int, *, start: int = 0) -> Iterator[bytes]:
        """Content of a file of `size` bytes from `start`, piece by piece; never more."""
        for begin in range(start, size, PIECE_BYTES):
            end = min(begin + PIECE_BYTES, size)
            with self._telling("read", name):
                piece = self._files.cat_file(self._path(name), start=begin, end=end)
            yield piece[: end - begin]

    def size(self, name: str) -> int | None:
        """Bytes of a file, None where there is none: a pipe or a device is none."""
        with self._telling("read", name):
            try:
                about = self._files.info(self._path(name))
            except FileNotFoundError as error:
                # Over HTTP also where nobody answers.
                if isinstance(error.__cause__, OSError):
                    raise error.__cause__ from None
                return None
        return int(about["size"]) if about["type"] == "file" else None

    def sizes(self, folder: str) -> dict[str, int]:
        """Names of the files under a folder with their bytes; none where there is no folder."""
        with self._telling("list", folder):
            try:
                found = self._files.find(self._path(folder), detail=True)
            except FileNotFoundError:
                return {}
        sizes = {}
        for path, about in found.items():
            # What is listed as another thing is a link to a file, or a pipe or a device.
            is_file = about["type"] == "file"
            size = int(about["size"]) if is_file else self.size(self._name(path))
            if size is not None:
                sizes[self._name(path)] = size
        return sizes

    def write(self, name: str, content: bytes) -> None:
        """Put a small file there, over one of that name."""
        path = self._path(name)
        with self._telling("write", name):
            if not self._is_local:
                # No folders are made: fsspec would make a bucket, too, of a name that is misspelt.
                self._files.pipe_file(path, content)
                return
            with replacing(Path(path)) as file:
                file.write(content)

    def upload(self, name: str, source: Path) -> None:
        """Put a copy of a local file there, over one of that name."""
        with self._telling("write", name):
            if not self._is_local:
                self._files.put_file(str(source), self._path(name))
                return
            # fsspec would copy into place, where a crash leaves half a file.
            with source.open("rb") as content, replacing(Path(self._path(name))) as file:
                while piece := content.read(PIECE_BYTES):
                    file.write(piece)

    def require_writable(self) -> None:
        """Write a file and take it away again: hours of work are not to end in a refusal.

        Raises
        ------
        StorageError
            The place cannot be written.
        """
        name = f"{uuid.uuid4().hex}.trial"
        try:
            self.write(name, b"")
        except StorageError as error:
            raise StorageError(str(error).replace(f"/{name}", "")) from None
        self.discard(name)

    def discard(self, name: str) -> None:
        """Delete a file that nobody needs any more; some may write, but not delete: it stays."""
        with suppress(Exception):
            self._files.rm_file(self._path(name))

    @property
    def folder(self) -> Path | None:
        """Where it lies on this machine; None elsewhere."""
        return Path(self._root) if self._is_local else None

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    def _name(self, path: str) -> str:
        return path.removeprefix(f"{self._root}/")

    def _shown(self, name: str) -> str:
        return f"{self.url}/{name}" if name else self.url

    @contextmanager
    def _telling(self, verb: str, name: str) -> Iterator[None]:
        """Whatever a backend raises, as one sentence with the URL."""
        try:
            yield
        except StorageError:
            raise
        # Each backend has errors of its own, which share no class.
        except Exception as error:
            missing = isinstance(error, FileNotFoundError)
            reason = "no such file or bucket" if missing else in_one_line(error)
            raise StorageError(f"cannot {verb} {self._shown(name)}: {reason}") from None


def require_plain(url: str) -> None:
    """Refuse URLs that would tell a password to whoever reads a message or a result.

    Nor chained ones (`reference::https://...`): what lies at one would name what else is read.

    Raises
    ------
    StorageError
        Tells the protocol alone.
    """
    if PASSWORD.search(url):
        raise StorageError(
            f"the URL of a place at {url.partition(':')[0]}:// has a password or a question in it; "
            "expected neither: keys are taken from where the package for it looks for them, such "
            "as the environment"
        )
    if "::" in url:
        raise StorageError(f"{url} is no place: made of several; expected one URL")


def _opened(url: str) -> tuple[Any, str]:
    """fsspec's file system and the path in it."""
    try:
        from fsspec.core import url_to_fs
    except ImportError:
        raise StorageError(
            f"{url} needs the package fsspec; `pip install 'shotenv[scale]'` brings it"
        ) from None
    try:
        # Without its memory of listings: others write there as well.
        return url_to_fs(url, use_listings_cache=False)
    except ImportError as error:
        raise StorageError(
            f"{url} needs a package that is not installed: {in_one_line(error)}"
        ) from None
    # No such protocol; or what backends raise that connect at once, each its own errors.
    except Exception as error:
        raise StorageError(f"{url} is no place: {in_one_line(error)}") from None


def _protocols(files: Any) -> tuple[str, ...]:
    return (files.protocol,) if isinstance(files.protocol, str) else tuple(files.protocol)
