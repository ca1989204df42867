"""How a bank lies on disk, and how it gets there whole or not at all.

    <bank>/manifest.json            written last: schema, configuration, one record per clip
    <bank>/clips/<clip>/clip.json   the clip's own record, with a sha256 per array file
    <bank>/clips/<clip>/*.npy       one array per quantity, frames first (see `ARRAYS`)

A clip is written into a hidden folder, flushed, and renamed; so whatever stands under a final
name is complete. Nothing in a bank is unpickled to be read.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from shotenv.config import BankConfig, Split, one_sentence
from unwrap.support import write_json

SCHEMA_VERSION: Final = 1
MANIFEST, CLIP_RECORD = "manifest.json", "clip.json"
LARGEST_JSON_BYTES = 64 * 2**20


class BankError(ValueError):
    """A bank that is missing, damaged or cannot be written; the message names file and cure."""


@dataclass(frozen=True)
class ArraySpec:
    """One array of a clip: its type, the shape of one frame (before height and width), its unit."""

    dtype: str
    channels: tuple[int, ...]
    unit: str

    def frame_bytes(self, height: int, width: int) -> int:
        """Bytes of one frame."""
        return int(np.prod((*self.channels, height, width))) * np.dtype(self.dtype).itemsize


ARRAYS: Mapping[str, ArraySpec] = {
    "correlation": ArraySpec("float32", (8,), "W m-2 sr-1 W-1"),
    "active": ArraySpec("float32", (), "W m-2 sr-1 W-1"),
    "ambient": ArraySpec("float32", (), "W m-2 sr-1"),
    "distance_m": ArraySpec("float32", (), "m"),
    "gray": ArraySpec("uint16", (), "LSB"),
}


class ClipRecord(BaseModel):
    """What the manifest tells of a clip: where it comes from and what each frame was."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")
    family: str = Field(pattern=r"^[A-Za-z0-9_-]{1,80}$")
    seed: int
    split: Split
    frames: int = Field(ge=1)
    folder: str = Field(pattern=r"^clips/[A-Za-z0-9_-]{1,80}$")
    time_s: tuple[float, ...]
    ego_speed_m_s: tuple[float, ...]
    yaw_rate_rad_s: tuple[float, ...]
    gray_exposure_s: tuple[float, ...]
    sha256: dict[str, str]

    @model_validator(mode="after")
    def _complete(self) -> ClipRecord:
        for field in ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s"):
            if len(getattr(self, field)) != self.frames:
                raise ValueError(f"{field} has {len(getattr(self, field))} values; expected frames")
        if set(self.sha256) != set(ARRAYS):
            raise ValueError(f"sha256 names {sorted(self.sha256)}; expected {sorted(ARRAYS)}")
        return self


class Manifest(BaseModel):
    """The bank's table of contents."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    schema_version: Literal[1] = SCHEMA_VERSION
    name: str
    height: int = Field(ge=1, le=4096)
    width: int = Field(ge=1, le=4096)
    units: dict[str, str]
    config: BankConfig | None
    clips: tuple[ClipRecord, ...] = Field(min_length=1)

    @property
    def fingerprint(self) -> str:
        """Sixteen hexadecimal digits that change when any array of the bank changes."""
        digest = hashlib.sha256()
        for clip in self.clips:
            digest.update(json.dumps([clip.name, sorted(clip.sha256.items())]).encode())
        return digest.hexdigest()[:16]


def frame_bytes(height: int, width: int) -> int:
    """Bytes that one frame takes on disk."""
    return sum(spec.frame_bytes(height, width) for spec in ARRAYS.values())


def write_clip(
    folder: Path, arrays: Mapping[str, np.ndarray], metadata: Mapping[str, Any]
) -> ClipRecord:
    """Write a clip's arrays and its record under `folder`, atomically.

    Parameters
    ----------
    folder
        `<bank>/clips/<name>`; must not exist yet.
    arrays
        One array for each name in `ARRAYS`, shape [frames, channels..., H, W].
    metadata
        The fields of `ClipRecord` that are not derived here: name, family, seed, split, time_s,
        ego_speed_m_s, yaw_rate_rad_s, gray_exposure_s.

    Raises
    ------
    BankError
        An array is missing, has the wrong type or shape or holds NaN, or the disk is full.
    """
    frames, height, width = _checked_shape(arrays)
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}")
    shutil.rmtree(temporary, ignore_errors=True)
    try:
        temporary.mkdir(parents=True)
        hashes = {name: _write_array(temporary, name, arrays[name]) for name in ARRAYS}
        record = ClipRecord(**metadata, frames=frames, folder=f"clips/{folder.name}", sha256=hashes)
        write_json(temporary / CLIP_RECORD, {**record.model_dump(), "shape": [height, width]})
        _publish(temporary, folder)
    except OSError as error:
        shutil.rmtree(temporary, ignore_errors=True)
        raise BankError(
            f"cannot write {folder}: {error.strerror}; free space or choose another "
            "cache folder with SHOTENV_CACHE"
        ) from None
    return record


def _publish(temporary: Path, folder: Path) -> None:
    try:
        temporary.rename(folder)
    except OSError:
        # A worker that outlived its killed parent for a moment may have written the same clip.
        if not (folder / CLIP_RECORD).is_file():
            raise
        shutil.rmtree(temporary)
    _flush_folder(folder.parent)


def _checked_shape(arrays: Mapping[str, np.ndarray]) -> tuple[int, int, int]:
    missing = set(ARRAYS) - set(arrays)
    if missing:
        raise BankError(f"clip lacks the arrays {sorted(missing)}")
    frames, height, width = arrays["gray"].shape
    for name, spec in ARRAYS.items():
        array, shape = arrays[name], (frames, *spec.channels, height, width)
        if array.shape != shape or array.dtype != spec.dtype:
            raise BankError(f"{name} is {array.dtype} {array.shape}; expected {spec.dtype} {shape}")
        if array.dtype.kind == "f" and np.isnan(array).any():
            raise BankError(f"{name} holds NaN")
    return frames, height, width


def _write_array(folder: Path, name: str, array: np.ndarray) -> str:
    path = folder / f"{name}.npy"
    with path.open("wb") as file:
        np.save(file, np.ascontiguousarray(array), allow_pickle=False)
        file.flush()
        os.fsync(file.fileno())
    return sha256_of(path)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _flush_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_manifest(
    folder: Path,
    name: str,
    clips: Iterable[ClipRecord],
    size: tuple[int, int],
    config: BankConfig | None = None,
) -> Manifest:
    """Write the table of contents; `size` is (height, width). This makes the bank complete."""
    manifest = Manifest(
        name=name,
        height=size[0],
        width=size[1],
        config=config,
        clips=tuple(clips),
        units={key: spec.unit for key, spec in ARRAYS.items()},
    )
    write_json(folder / MANIFEST, manifest.model_dump(mode="json"))
    return manifest


def read_clip_record(folder: Path) -> ClipRecord | None:
    """Record of a finished clip, or None where there is none."""
    path = folder / CLIP_RECORD
    if not path.is_file():
        return None
    content = _load_json(path)
    content.pop("shape", None)
    return _validated(ClipRecord, content, path)


def read_manifest(folder: Path) -> Manifest:
    """Table of contents of the bank in `folder`.

    Raises
    ------
    BankError
        It is missing, not JSON, oversized, of another schema, or inconsistent.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise BankError(
            f"{folder} holds no {MANIFEST}: not a bank, or its rendering was cut off; "
            "run `shotenv render` to finish it"
        )
    manifest = _validated(Manifest, _load_json(path), path)
    for clip in manifest.clips:
        for name, spec in ARRAYS.items():
            _check_header(folder / clip.folder / f"{name}.npy", clip, spec, manifest)
    return manifest


def _load_json(path: Path) -> dict:
    if path.stat().st_size > LARGEST_JSON_BYTES:
        raise BankError(f"{path} is larger than {LARGEST_JSON_BYTES} bytes; refused")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, ValueError, RecursionError):
        raise BankError(f"{path} is damaged (not JSON); {_cure(path)}") from None
    if not isinstance(content, dict):
        raise BankError(f"{path} is damaged (not a table); {_cure(path)}")
    return content


def _validated(model, content: dict, path: Path):
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise BankError(f"{path} is damaged ({one_sentence(error)}); {_cure(path)}") from None


def _cure(path: Path) -> str:
    return f"delete {path if path.name == MANIFEST else path.parent} and render the bank again"


def _check_header(path: Path, clip: ClipRecord, spec: ArraySpec, manifest: Manifest) -> None:
    """Refuse an array file whose header or length is not what the manifest says."""
    shape = (clip.frames, *spec.channels, manifest.height, manifest.width)
    expected = int(np.prod(shape)) * np.dtype(spec.dtype).itemsize
    try:
        with path.open("rb") as file:
            version = np.lib.format.read_magic(file)
            if version != (1, 0):
                raise ValueError("unexpected version")
            found, fortran, dtype = np.lib.format.read_array_header_1_0(file)
            length = path.stat().st_size - file.tell()
    except (OSError, ValueError):
        raise BankError(f"{path} is missing or damaged; {_cure(path)}") from None
    if found != shape or fortran or dtype != spec.dtype or length != expected:
        raise BankError(
            f"{path} holds {dtype} {found}, {length} bytes; expected {spec.dtype} "
            f"{shape}, {expected} bytes; {_cure(path)}"
        )


def verify(folder: Path, *, tick: Callable[[], object] = lambda: None) -> tuple[str, ...]:
    """Names of the files that are not as they were written; empty is good.

    Arrays are compared with the manifest's sha256, the clips' own records with the manifest.

    Parameters
    ----------
    tick : callable
        Called after each clip.

    Raises
    ------
    BankError
        The manifest or an array's header is damaged.
    """
    damaged: list[str] = []
    for clip in read_manifest(folder).clips:
        damaged += [f"{clip.folder}/{name}" for name in _damaged_files(folder / clip.folder, clip)]
        tick()
    return tuple(damaged)


def _damaged_files(folder: Path, clip: ClipRecord) -> Iterator[str]:
    for name, digest in clip.sha256.items():
        if sha256_of(folder / f"{name}.npy") != digest:
            yield f"{name}.npy"
    try:
        same = read_clip_record(folder) == clip
    except BankError:
        same = False
    if not same:
        yield CLIP_RECORD
