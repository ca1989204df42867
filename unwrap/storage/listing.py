"""Which files a part or a folder has, by the digest of what is in them; a small JSON file."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from unwrap.storage.place import StorageError
from unwrap.support import in_one_line, open_regular

LARGEST_JSON_BYTES = 64 * 2**20
WORD = r"[A-Za-z0-9_-][A-Za-z0-9_.-]*"
"""A part of a path: it cannot be `..` nor hidden."""
PATH = rf"{WORD}(/{WORD})*"


class StoredFile(BaseModel):
    """A file: its path in the folder that it belongs to, its digest and length."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    path: str = Field(pattern=rf"^{PATH}$", max_length=400)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    bytes: int = Field(ge=0, le=2**40)

    @property
    def object_name(self) -> str:
        """Where what is in it lies on a place."""
        return f"objects/{self.sha256}"


class Listing(BaseModel):
    """Files of a part or of a whole folder, in the order in which they are fetched.

    `label` says what they belong to: files of two labels are never mixed.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = 1
    label: str = Field(pattern=rf"^{WORD}$", max_length=200)
    files: tuple[StoredFile, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _each_path_once(self) -> Self:
        if len({file.path for file in self.files}) < len(self.files):
            raise ValueError("files has a path twice; expected each once")
        return self

    @property
    def total_bytes(self) -> int:
        """Of all files."""
        return sum(file.bytes for file in self.files)

    @property
    def digest(self) -> str:
        """Changes with any file, its path or its content; hexadecimal."""
        return _digest_of(self.model_dump(mode="json"))

    def encoded(self) -> bytes:
        """As JSON, with a digest of itself."""
        content = self.model_dump(mode="json")
        return json.dumps({**content, "digest": _digest_of(content)}, indent=1).encode()

    @classmethod
    def decoded(cls, encoded: bytes) -> Self:
        """From what `encoded` gave.

        Raises
        ------
        ValueError
            It is not JSON, not as it was written, or names what no listing may.
        """
        try:
            content = json.loads(encoded)
        except (UnicodeDecodeError, ValueError, RecursionError):
            raise ValueError("not JSON") from None
        if not isinstance(content, dict) or content.pop("digest", None) != _digest_of(content):
            raise ValueError("not as it was written")
        try:
            return cls.model_validate(content)
        except ValidationError as error:
            raise ValueError(in_one_line(error)) from None


def _digest_of(content: dict) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def require_storable(path: str) -> None:
    """Refuse a path that no listing may have.

    Raises
    ------
    ValueError
        Names it and what is expected.

    Examples
    --------
    >>> require_storable("default/my_rule-0")
    """
    if re.fullmatch(PATH, path) is None:
        raise ValueError(
            f"{path!r} cannot be published; expected letters, digits, '_', '-' and '.' in its names"
        )


def stored_files(folder: Path, names: Iterable[str], *, under: str = "") -> tuple[StoredFile, ...]:
    """The files `names` of a local folder; their paths begin with `under`.

    Raises
    ------
    StorageError
        One is no regular file, or has a name that no listing may have.
    """
    prefix = f"{under}/" if under else ""
    found = []
    for name in names:
        try:
            require_storable(name)
            with open_regular(folder / name) as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
                size = file.tell()
        except ValueError as error:
            raise StorageError(f"{folder / name} cannot be published: {error}") from None
        found.append(StoredFile(path=f"{prefix}{name}", sha256=digest, bytes=size))
    return tuple(found)
