"""A bank on a place (`s3://...`, `file:///...`): published there clip by clip, fetched and opened.

What a place holds is byte for byte what a folder would: see `unwrap.storage` for how it lies there.
"""

from __future__ import annotations

import hashlib
import json
import tempfile
from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from shotenv.bank.bank import Bank
from shotenv.bank.build import bank_bytes, render_clips
from shotenv.bank.clip_jobs import ClipJob, clip_jobs
from shotenv.bank.files import (
    CLIP_RECORD,
    CLIPS,
    MANIFEST,
    RECORDED_CONTENTS,
    SOURCE,
    THINNED_CONTENTS,
    BankError,
    ClipRecord,
    Manifest,
    RecordedClip,
    TableOfContents,
    alone_in,
    bank_folder,
    fetched_banks,
    identity,
    read_table,
    write_manifest,
)
from shotenv.config import BankConfig
from unwrap.execution import Executor
from unwrap.storage import (
    Listing,
    Place,
    StoredFile,
    damaged_files,
    fetch,
    place_to_publish,
    publish_contents,
    publish_part,
    read_contents,
    require_storable,
    standing_parts,
)
from unwrap.support import in_one_line, progress, say, write_json

LARGEST_RECORD = 2**24
"""Bytes; that of a clip of 4096 frames has some 350 kB."""
TABLES = (MANIFEST, THINNED_CONTENTS, RECORDED_CONTENTS)


def build_published(
    config: BankConfig, url: str, *, workers: int | None = None, executor: Executor = "local"
) -> None:
    """Render the bank of `config` onto a place; clips that stand there are kept.

    Each worker renders a clip into a folder of its own machine, publishes it and deletes it.

    Parameters
    ----------
    workers, executor
        As of `build_bank`; the machines of a cluster need no folder in common.

    Raises
    ------
    unwrap.storage.StorageError
        The place holds another bank, or cannot be read or written.
    BankError, RendererError, WorkerError
        As of `build_bank`.
    """
    place = place_to_publish(url, bank_folder(config).name)
    standing = standing_clips(url, config)
    jobs = clip_jobs(config, Path())
    missing = [replace(job, url=url) for job in jobs if job.name not in standing]
    frames = sum(job.frames for job in missing)
    say(
        f"Rendering bank '{config.name}' to {place.url}: {len(missing)} of {len(jobs)} clips, "
        f"{frames} frames, {bank_bytes(config, frames) / 1e6:.0f} MB. It can be interrupted; the "
        "next start continues."
    )
    render_clips(missing, workers, executor)
    finish_published(url, config)


def standing_clips(url: str, config: BankConfig) -> frozenset[str]:
    """Names of the clips of `config` that are published at `url`, whole.

    Raises
    ------
    unwrap.storage.StorageError
        The place cannot be read.
    """
    return frozenset(standing_parts(Place(url), bank_folder(config).name))


def publish_clip(url: str, job: ClipJob) -> None:
    """Publish a clip that stands in its folder; what others have published of it stays.

    Raises
    ------
    unwrap.storage.StorageError
        The place cannot be written.
    """
    label = bank_folder(job.config).name
    publish_part(Place(url), label, job.name, job.folder, under=f"{CLIPS}/{job.name}")


def finish_published(url: str, config: BankConfig) -> None:
    """Publish the table of contents of a bank of which all clips stand: this makes it complete.

    Raises
    ------
    BankError
        A clip is missing, or its record is damaged.
    unwrap.storage.StorageError
        The place holds another bank, or cannot be written.
    """
    place, label = Place(url), bank_folder(config).name
    parts, names = standing_parts(place, label), [job.name for job in clip_jobs(config, Path())]
    if missing := [name for name in names if name not in parts]:
        raise BankError(
            f"{place.url} lacks {len(missing)} of {len(names)} clips, such as {missing[0]}; run "
            "`shotenv render --to` again"
        )
    records = _clip_records(place, {name: parts[name] for name in names})
    size = (config.camera.height, config.camera.width)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        write_json(folder / SOURCE, identity(config))
        write_manifest(folder, config.name, records, size, config)
        listings = [parts[name] for name in names]
        publish_contents(place, label, listings, folder, [SOURCE, MANIFEST])


def _clip_records(place: Place, parts: dict[str, Listing]) -> list[ClipRecord]:
    """The clips' own records, in the order of `parts`."""
    files = {}
    for name, listing in parts.items():
        where = f"{CLIPS}/{name}"
        own = {file.path: file for file in listing.files}
        record = own.get(f"{where}/{CLIP_RECORD}")
        if record is None or any(Path(path).parent != Path(where) for path in own):
            raise BankError(
                f"{place.url}/parts/{listing.label}/{name}.json lists what is no clip; delete it "
                "and run `shotenv render --to` again"
            )
        files[name] = record
    # Lengths were compared: what is larger than any record is not fetched.
    found = place.read_all({f.object_name for f in files.values() if f.bytes < LARGEST_RECORD})
    records = []
    for name, file in files.items():
        content = found.get(file.object_name, b"")
        try:
            if hashlib.sha256(content).hexdigest() != file.sha256:
                raise ValueError("not as it was written")
            fields = json.loads(content)
            if not isinstance(fields, dict):
                raise ValueError("not a table")
            fields.pop("shape", None)
            records.append(ClipRecord.model_validate(fields))
        except (ValueError, RecursionError) as error:
            raise BankError(
                f"{place.url}/{file.object_name}, the record of clip {name}, is damaged "
                f"({in_one_line(error)}); delete it and run `shotenv render --to` again"
            ) from None
    return records


def publish_bank(bank: Bank, url: str) -> Listing:
    """Publish a bank of any kind that stands in a folder; continues where it was cut off.

    Raises
    ------
    BankError
        It has links that lead out of its folder, or the place is a folder of its own.
    ValueError
        Its name cannot be part of a path.
    unwrap.storage.StorageError
        The place holds another bank, or cannot be written; or something is no regular file.
    """
    folder, target = bank.folder.resolve(), Place(url).folder
    if target is not None and target.resolve().is_relative_to(folder):
        raise BankError(f"{url} lies in the bank, {folder}; expected a place outside of it")
    if isinstance(bank.manifest, Manifest) and bank.config is not None:
        label = bank_folder(bank.config).name  # As `publish_clip` has it.
    else:
        label = f"{bank.name}-{bank.fingerprint[:8]}"
    require_storable(label)
    _require_within(folder)
    place = place_to_publish(url, label)
    clips = [
        clip.folder for clip in bank.manifest.clips if isinstance(clip, ClipRecord | RecordedClip)
    ]
    parts = []
    with progress(len(clips), "publishing", "clip") as bar:
        for clip in clips:
            name = Path(clip).name
            parts.append(publish_part(place, label, name, folder / clip, under=clip))
            bar.update()
    rest = sorted(path.name for path in folder.iterdir() if _belongs(path))
    # What makes a folder a bank comes last.
    return publish_contents(place, label, parts, folder, sorted(rest, key=TABLES.__contains__))


def _require_within(folder: Path) -> None:
    """Refuse links out of a bank: who made it may mean files that are nobody's business."""
    for path in folder.rglob("*"):
        if path.is_symlink() and not path.resolve().is_relative_to(folder):
            raise BankError(
                f"{path} leads to {path.resolve()}, out of the bank; put a copy of it there to "
                "publish it"
            )


def _belongs(path: Path) -> bool:
    return path.is_file() and not path.name.startswith(".")


def fetch_bank(url: str) -> Path:
    """Folder of the bank at `url` in the local cache, fetched first where it is not there yet.

    Resumable; a bank that has changed is fetched into a folder of its own.

    Raises
    ------
    BankError
        What is there is no bank.
    unwrap.storage.StorageError
        Nothing is there, the place cannot be read, a file is damaged, or the disk is full.
    """
    place = Place(url)
    contents = _contents_of_bank(place)
    table = contents.files[-1].path
    folder = fetched_banks() / f"{contents.label}-{contents.digest[:16]}"
    # Without the lock, which a folder that can only be read would not give.
    if (folder / table).is_file():
        return folder
    folder.mkdir(parents=True, exist_ok=True)
    with alone_in(folder), _bytes_bar(contents, f"fetching {contents.label}") as bar:
        fetch(place, contents, folder, tick=bar.update)
    return folder


def _contents_of_bank(place: Place) -> Listing:
    contents = read_contents(place)
    if contents.files[-1].path not in TABLES:
        raise BankError(f"{place.url} holds {contents.label}, which is no bank")
    return contents


def published_table(url: str) -> tuple[TableOfContents, int]:
    """Table of contents of the bank at `url` and its bytes, without fetching its arrays.

    Raises
    ------
    BankError, unwrap.storage.StorageError
        As of `fetch_bank`.
    """
    place = Place(url)
    contents = _contents_of_bank(place)
    table = contents.files[-1]
    with tempfile.TemporaryDirectory() as folder:
        fetch(place, contents.model_copy(update={"files": (table,)}), Path(folder))
        return read_table(Path(folder) / table.path), contents.total_bytes


def verify_published(url: str) -> tuple[StoredFile, ...]:
    """Files at `url` that are missing or not as they were published; empty is good.

    Raises
    ------
    unwrap.storage.StorageError
        Nothing is there, the table of contents is damaged, or the place cannot be read.
    """
    place = Place(url)
    contents = read_contents(place)
    with _bytes_bar(contents, "verifying") as bar:
        return damaged_files(place, contents, tick=bar.update)


def _bytes_bar(contents: Listing, what: str) -> tqdm:
    bar = progress(contents.total_bytes, what, "B")
    bar.unit, bar.unit_scale = "B", True
    return bar
