"""Files of a bank: written whole or not at all, and refused by name when they are damaged.

A clip is written into a hidden folder, flushed, and renamed; so whatever stands under a final
name is complete. Nothing in a bank is unpickled to be read. What lies where:
`shotenv.bank.files.layout`.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from pydantic import ValidationError

from shotenv.bank.files.damage import (
    check_header,
    check_packed,
    cure_for,
    require_place,
)
from shotenv.bank.files.layout import (
    ARRAYS,
    CLIP_RECORD,
    CLIPS,
    MANIFEST,
    PACKED_SUFFIX,
    RECORDED_CONTENTS,
    THINNED_CONTENTS,
    THINNED_FILE,
    BankError,
    ClipRecord,
    Manifest,
    RecordedClip,
    RecordedContents,
    TableOfContents,
    ThinnedContents,
    array_file,
)
from shotenv.bank.files.packed import packed
from shotenv.config import BankConfig, Storage, one_sentence
from unwrap.support import open_regular, write_json

Contents = TypeVar("Contents", bound=TableOfContents)
LARGEST_JSON_BYTES = 512 * 2**20
"""A manifest has some 85 bytes for each frame: six million of them."""


def write_clip(
    folder: Path,
    arrays: Mapping[str, np.ndarray],
    metadata: Mapping[str, Any],
    *,
    storage: Storage = "float32",
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
    storage
        As `BankConfig.storage`.

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
        hashes = {n: _write(temporary / array_file(n, storage), n, arrays[n]) for n in ARRAYS}
        where = f"{CLIPS}/{folder.name}"
        record = ClipRecord(**metadata, frames=frames, folder=where, sha256=hashes)
        write_json(temporary / CLIP_RECORD, {**record.model_dump(), "shape": [height, width]})
        _publish(temporary, folder)
    except OSError as error:
        shutil.rmtree(temporary, ignore_errors=True)
        raise BankError(
            f"cannot write {folder}: {error.strerror or error}; free space or choose another "
            "cache folder with SHOTENV_CACHE"
        ) from None
    return record


def _publish(temporary: Path, folder: Path) -> None:
    """Give a clip that is whole its final name, so that it lasts if the power fails now."""
    try:
        temporary.rename(folder)
    except OSError:
        # A worker that outlived its killed parent for a moment may have written the same clip.
        shutil.rmtree(temporary)
        require_place(folder)
        if not (folder / CLIP_RECORD).is_file():
            raise
    # The name is an entry of the folder above, which is flushed like a file.
    descriptor = os.open(folder.parent, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _checked_shape(arrays: Mapping[str, np.ndarray]) -> tuple[int, int, int]:
    """Frames, height and width of a clip's arrays, or BankError where they are not sound."""
    missing = set(ARRAYS) - set(arrays)
    if missing:
        raise BankError(f"clip lacks the arrays {sorted(missing)}")
    frames, height, width = arrays["gray"].shape  # It has no channels between.
    for name, spec in ARRAYS.items():
        array, shape = arrays[name], (frames, *spec.channels, height, width)
        if array.shape != shape or array.dtype != spec.dtype:
            raise BankError(f"{name} is {array.dtype} {array.shape}; expected {spec.dtype} {shape}")
        if array.dtype.kind == "f" and np.isnan(array).any():
            raise BankError(f"{name} holds NaN")
    return frames, height, width


def _write(path: Path, name: str, array: np.ndarray) -> str:
    """Write an array of a clip, as the file's name tells; returns its SHA-256."""
    if path.suffix == PACKED_SUFFIX:
        return _write_flushed(path, lambda file: file.writelines(packed(name, array)))
    return write_array(path, array)


def write_array(path: Path, array: np.ndarray) -> str:
    """Write an array file, flushed to the disk; returns its SHA-256."""
    content = np.ascontiguousarray(array)
    return _write_flushed(path, lambda file: np.save(file, content, allow_pickle=False))


def _write_flushed(path: Path, write: Callable[[BinaryIO], object]) -> str:
    try:
        with path.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:  # NumPy's tells neither the file nor a number, nor that it is full.
        why = error.strerror or f"{error}; is the disk full?"
        raise OSError(error.errno, why, str(path)) from None
    return sha256_of(path)


def sha256_of(path: Path) -> str:
    """SHA-256 of a file, hexadecimal; BankError where it is no regular one."""
    try:
        with open_regular(path) as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except ValueError as error:
        raise BankError(f"{path} is damaged ({error}); {cure_for(path)}") from None


def write_manifest(
    folder: Path,
    name: str,
    clips: Iterable[ClipRecord],
    size: tuple[int, int],
    config: BankConfig | None = None,
) -> Manifest:
    """Write the table of contents, with a digest of itself: this makes the bank complete.

    `size` is (height, width).
    """
    manifest = Manifest(
        name=name,
        height=size[0],
        width=size[1],
        config=config,
        clips=tuple(clips),
        units={key: spec.unit for key, spec in ARRAYS.items()},
    )
    _write_contents(folder / MANIFEST, manifest)
    return manifest


def read_clip_record(folder: Path) -> ClipRecord | None:
    """Record of a finished clip, or None where there is none."""
    path = folder / CLIP_RECORD
    if not path.is_file():
        return None
    content = _load_json(path)
    content.pop("shape", None)  # For people who look at it; the arrays have it in their headers.
    return _validated(ClipRecord, content, path)


def read_manifest(folder: Path) -> Manifest:
    """Table of contents of the bank in `folder`.

    Raises
    ------
    BankError
        It is missing, not JSON, oversized, of another schema, inconsistent, or not as it was
        written; older ones, which have no digest of themselves, do not tell the last.
    """
    path = folder / MANIFEST
    if not path.is_file():
        raise BankError(
            f"{folder} holds no {MANIFEST}: not a bank, or its rendering was cut off; "
            "run `shotenv render` to finish it"
        )
    manifest = _read_contents(Manifest, path, undigested=True)
    for clip in manifest.clips:
        for name, spec in ARRAYS.items():
            path = folder / clip.folder / array_file(name, manifest.storage)
            if manifest.storage == "float16":
                check_packed(path, clip.frames)
                continue
            shape = (clip.frames, *spec.channels, manifest.height, manifest.width)
            check_header(path, spec.dtype, shape)
    return manifest


def write_thinned_contents(folder: Path, contents: ThinnedContents) -> None:
    """Write the table of contents of a thinned bank, with a digest of itself."""
    _write_contents(folder / THINNED_CONTENTS, contents)


def write_recorded_contents(folder: Path, contents: RecordedContents) -> None:
    """Write the table of contents of a bank of recordings, with a digest of itself."""
    _write_contents(folder / RECORDED_CONTENTS, contents)


def _write_contents(path: Path, contents: TableOfContents) -> None:
    content = contents.model_dump(mode="json")
    write_json(path, {**content, "digest": _digest_of(content)})


def read_thinned_contents(folder: Path) -> ThinnedContents:
    """Table of contents of the thinned bank in `folder`.

    Raises
    ------
    BankError
        It is not JSON, oversized, of another schema, or not as it was written.
    """
    return _read_contents(ThinnedContents, folder / THINNED_CONTENTS)


def read_recorded_contents(folder: Path) -> RecordedContents:
    """Table of contents of the bank of recordings in `folder`.

    Raises
    ------
    BankError
        As of a thinned bank, or an array file is not of the type and length that it tells.
    """
    contents = _read_contents(RecordedContents, folder / RECORDED_CONTENTS)
    for clip in contents.clips:
        for name, (dtype, shape) in contents.arrays(clip.frames).items():
            check_header(folder / clip.folder / f"{name}.npy", dtype, shape)
    return contents


def read_table(path: Path) -> TableOfContents:
    """Table of contents of a bank of any kind, whose arrays need not be there."""
    if path.name == MANIFEST:
        return _read_contents(Manifest, path, undigested=True)
    return _read_contents(
        ThinnedContents if path.name == THINNED_CONTENTS else RecordedContents, path
    )


def _read_contents(model: type[Contents], path: Path, *, undigested: bool = False) -> Contents:
    content = _load_json(path)
    if undigested and "digest" not in content:
        return _validated(model, content, path)
    if content.pop("digest", None) != _digest_of(content):
        raise BankError(f"{path} is damaged (not as it was written); {cure_for(path)}")
    return _validated(model, content, path)


def _digest_of(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _load_json(path: Path) -> dict:
    if path.stat().st_size > LARGEST_JSON_BYTES:
        raise BankError(f"{path} is larger than {LARGEST_JSON_BYTES} bytes; refused")
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, ValueError, RecursionError):
        raise BankError(f"{path} is damaged (not JSON); {cure_for(path)}") from None
    if not isinstance(content, dict):
        raise BankError(f"{path} is damaged (not a table); {cure_for(path)}")
    return content


def _validated(model, content: dict, path: Path):
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise BankError(f"{path} is damaged ({one_sentence(error)}); {cure_for(path)}") from None


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
    if (folder / THINNED_CONTENTS).is_file():
        whole = sha256_of(folder / THINNED_FILE) == read_thinned_contents(folder).sha256
        return () if whole else (THINNED_FILE,)
    if (folder / RECORDED_CONTENTS).is_file():
        for recorded in read_recorded_contents(folder).clips:
            damaged += _damaged_arrays(folder, recorded, "float32")
            tick()
        return tuple(damaged)
    manifest = read_manifest(folder)
    for clip in manifest.clips:
        damaged += _damaged_arrays(folder, clip, manifest.storage)
        try:
            same = read_clip_record(folder / clip.folder) == clip
        except BankError:
            same = False
        if not same:
            damaged.append(f"{clip.folder}/{CLIP_RECORD}")
        tick()
    return tuple(damaged)


def _damaged_arrays(folder: Path, clip: ClipRecord | RecordedClip, storage: Storage) -> list[str]:
    """Array files of a clip that have another digest than its record tells."""
    files = {f"{clip.folder}/{array_file(n, storage)}": sha for n, sha in clip.sha256.items()}
    return [path for path, digest in files.items() if sha256_of(folder / path) != digest]
