"""A place in memory that fails at the n-th operation, half way through where it writes."""

from __future__ import annotations

from typing import ClassVar

import fsspec
from fsspec.implementations.memory import MemoryFileSystem


class ConnectionLostError(OSError):
    """What a connection that breaks raises."""


class CutOffFileSystem(MemoryFileSystem):
    """Counts what is asked of it; operation number `fails_at` (from 1) is the last that begins."""

    protocol = "cutoff"
    store: ClassVar[dict] = {}
    pseudo_dirs: ClassVar[list[str]] = [""]
    operations = 0
    uploads: ClassVar[list[str]] = []
    fails_at = 0

    @classmethod
    def reset(cls, *, fails_at: int = 0, empty: bool = False) -> None:
        cls.operations, cls.fails_at, cls.uploads = 0, fails_at, []
        if empty:
            cls.store.clear()

    @classmethod
    def _strip_protocol(cls, path):
        return MemoryFileSystem._strip_protocol(path.replace("cutoff://", "memory://", 1))

    def _count(self) -> bool:
        """Whether this operation is to be cut off; those after it never begin."""
        kind = type(self)
        kind.operations += 1
        if kind.fails_at and kind.operations > kind.fails_at:
            raise ConnectionLostError("connection lost")
        return kind.operations == kind.fails_at

    def _write(self, path: str, content: bytes) -> None:
        half = self._count()
        self.uploads.append(path)
        super().pipe_file(path, content[: len(content) // 2] if half else content)
        if half:
            raise ConnectionLostError("connection lost")

    def pipe_file(self, path, value, mode="overwrite", **_):
        self._write(path, value)

    def put_file(self, lpath, rpath, **_):
        with open(lpath, "rb") as file:  # noqa: PTH123 - as fsspec does it
            self._write(rpath, file.read())

    def _read(self) -> None:
        if self._count():
            raise ConnectionLostError("connection lost")

    def cat_file(self, path, start=None, end=None, **_):
        self._read()
        return super().cat_file(path, start, end)

    def info(self, path, **_):
        self._read()
        return super().info(path)

    def find(self, path, maxdepth=None, withdirs=False, detail=False, **_):
        self._read()
        return super().find(path, maxdepth, withdirs, detail)


fsspec.register_implementation("cutoff", CutOffFileSystem, clobber=True)
