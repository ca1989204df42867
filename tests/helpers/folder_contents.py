"""Files of folders."""

from __future__ import annotations

from pathlib import Path


def contents_of(folder: Path, *, but: tuple[str, ...] = ()) -> dict[str, bytes]:
    """Content of every file below `folder`, by its path there; without those of these names."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name not in but)
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
