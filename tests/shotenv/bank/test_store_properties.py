"""The store as a machine: rendered, published, fetched, killed at any moment, damaged, mended.

Whatever was done before, what stands under a final name is whole, what is damaged is named, and
nothing that stood is lost.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import settings, strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from killed_moments import survives
from made_up_clips import write_made_up

from shotenv.bank import build, published
from shotenv.bank.clip_jobs import ClipJob, clip_jobs
from shotenv.bank.files import (
    ARRAYS,
    CLIP_RECORD,
    MANIFEST,
    SOURCE,
    BankError,
    fetched_banks,
    sha256_of,
    verify,
)
from shotenv.bank.opening import open_bank
from shotenv.bank.published import fetch_bank, publish_bank, verify_published
from shotenv.config.bank import BankConfig
from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import SensorConfig
from unwrap.storage.place import StorageError
from unwrap.support import files as whole_files

FRAMES, HEIGHT, WIDTH = 2, 16, 16
CONFIG = merged(
    BankConfig(name="small", sensor=read_config(SensorConfig, find_config("sensor", "epc660"))),
    {
        "camera": {"width": WIDTH, "height": HEIGHT},
        "world": {"frames_per_clip": FRAMES, "families": ["garage"]},
        **{"train_clips": 1, "validation_clips": 0, "test_clips": 1},
    },
)

moments = st.none() | st.integers(0, 80)
places = st.floats(0, 1, exclude_max=True)


def make_up(jobs: list[ClipJob], *rest: object) -> None:
    """In place of rendering."""
    for job in jobs:
        write_made_up(job)


def publish_made_up(jobs: list[ClipJob], *rest: object) -> None:
    """The same for a place, as a worker does it."""
    for job in jobs:
        with tempfile.TemporaryDirectory() as scratch:
            here = replace(job, folder=Path(scratch) / job.name)
            write_made_up(here)
            published.publish_clip(job.url, here)


def spoiled(content: bytes, how: str, place: float) -> bytes | None:
    """Content with a bit changed, cut off, or lengthened, at a place from 0 to 1; None: no file."""
    at = int(place * len(content))
    return {
        "flip": content[:at] + bytes([content[at] ^ (1 << at % 8)]) + content[at + 1 :],
        "cut": content[:at],
        "lengthen": content + b"\0",
        "delete": None,
    }[how]


kinds = st.sampled_from(["flip", "cut", "lengthen", "delete"])


def put(path: Path, content: bytes | None) -> None:
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)


def meaning(content: bytes | None) -> object:
    """Of a JSON file, but for what is only there for people to look at; None where it has none."""
    try:
        found = json.loads(content or b"")
    except ValueError:
        return None
    return {k: v for k, v in found.items() if k != "shape"} if isinstance(found, dict) else None


class StoreMachine(RuleBasedStateMachine):
    """A bank, a place that it is published on, and a cache that it is fetched into."""

    def __init__(self) -> None:
        super().__init__()
        self.root = Path(tempfile.mkdtemp())
        self.bank, self.place = self.root / "bank", self.root / "place"
        self.url = f"file://{self.place}"
        self.patch = pytest.MonkeyPatch()
        self.patch.setenv("SHOTENV_CACHE", str(self.root / "cache"))
        self.patch.setattr(build, "render_clips", make_up)
        self.patch.setattr(published, "render_clips", publish_made_up)
        self.patch.setattr(os, "fsync", lambda descriptor: None)
        # What is killed here is no process of its own: what it has left has an owner that runs.
        self.patch.setattr(whole_files, "_is_running", lambda process: False)
        self.stood: dict[Path, str] = {}

    def teardown(self) -> None:
        self.patch.undo()
        shutil.rmtree(self.root)

    # What is done, each of which may be killed.

    @rule(moment=moments)
    def render(self, moment) -> None:
        if survives(lambda: build.build_bank(CONFIG, self.bank, workers=1), moment, self.root):
            assert self.is_rendered
            assert not list(self.bank.rglob(".*.*"))  # Nothing half-written is left, either.

    @precondition(lambda self: self.is_rendered)
    @rule(moment=moments)
    def publish(self, moment) -> None:
        if survives(lambda: publish_bank(open_bank(self.bank), self.url), moment, self.root):
            assert self.is_published

    @rule(moment=moments)
    def render_to_the_place(self, moment) -> None:
        if survives(lambda: published.build_published(CONFIG, self.url), moment, self.root):
            assert self.is_published

    @precondition(lambda self: self.is_published)
    @rule(moment=moments)
    def fetch(self, moment) -> None:
        if survives(lambda: fetch_bank(self.url), moment, self.root):
            fetched = open_bank(self.url)
            assert verify(fetched.folder) == ()
            if self.is_rendered:
                assert fetched.fingerprint == open_bank(self.bank).fingerprint

    @precondition(lambda self: self.is_published)
    @rule()
    def forget_what_was_fetched(self) -> None:
        shutil.rmtree(fetched_banks(), ignore_errors=True)
        self.stood = {p: d for p, d in self.stood.items() if self.root / "cache" not in p.parents}

    @precondition(lambda self: self.is_rendered)
    @rule(number=st.integers(0, 1))
    def delete_a_clip(self, number) -> None:
        job = clip_jobs(CONFIG, self.bank)[number]
        shutil.rmtree(job.folder)
        self.stood = {p: d for p, d in self.stood.items() if job.folder not in p.parents}
        with pytest.raises(BankError, match=job.name):
            open_bank(self.bank)
        self.render(None)

    # What is damaged, found, and mended as the message says.

    @precondition(lambda self: self.is_rendered)
    @rule(pick=places, how=kinds, place=places)
    def damage_the_bank(self, pick, how, place) -> None:
        files = sorted(path for path in self.bank.rglob("*") if self.is_final(path))
        path = files[int(pick * len(files))]
        whole = path.read_bytes()
        put(path, spoiled(whole, how, place))
        left = path.read_bytes() if path.is_file() else None
        if path.suffix == ".npy" or meaning(left) != meaning(whole):
            self.is_named(path)
        path.write_bytes(whole)
        assert verify(self.bank) == ()

    def is_named(self, path: Path) -> None:
        if path.name == SOURCE:
            # What is read where the bank is continued, and not where it is opened.
            (self.bank / MANIFEST).rename(self.root / MANIFEST)
            with pytest.raises(BankError, match=str(self.bank)):
                build.build_bank(CONFIG, self.bank, workers=1)
            (self.root / MANIFEST).rename(self.bank / MANIFEST)
            return
        try:
            damaged = verify(self.bank)
        except BankError as error:
            assert str(path) in str(error) or (path.name == MANIFEST and MANIFEST in str(error))
        else:
            assert damaged == (str(path.relative_to(self.bank)),)

    @precondition(lambda self: self.is_published)
    @rule(pick=places, how=kinds, place=places)
    def damage_the_place(self, pick, how, place) -> None:
        objects = sorted((self.place / "objects").glob("[0-9a-f]*"))
        path = objects[int(pick * len(objects))]
        whole = path.read_bytes()
        put(path, spoiled(whole, how, place))
        # More than one file where clips have the same content.
        assert {file.sha256 for file in verify_published(self.url)} == {path.name}
        self.forget_what_was_fetched()
        with pytest.raises(StorageError, match=path.name):
            fetch_bank(self.url)
        self.what_stands_is_whole(but=path)
        path.unlink(missing_ok=True)
        self.render_to_the_place(None)
        assert verify_published(self.url) == () and path.read_bytes() == whole

    @precondition(lambda self: self.is_published)
    @rule(how=kinds, place=places)
    def damage_the_table_of_a_place(self, how, place) -> None:
        path = self.place / "contents.json"
        whole = path.read_bytes()
        put(path, spoiled(whole, how, place))
        if meaning(path.read_bytes() if path.is_file() else None) != meaning(whole):
            with pytest.raises(StorageError, match=r"contents\.json"):
                verify_published(self.url)
        path.unlink(missing_ok=True)
        self.render_to_the_place(None)
        assert path.read_bytes() == whole

    # What always holds.

    @property
    def is_rendered(self) -> bool:
        jobs = clip_jobs(CONFIG, self.bank)
        return (self.bank / MANIFEST).is_file() and all(job.stands for job in jobs)

    @property
    def is_published(self) -> bool:
        return (self.place / "contents.json").is_file()

    def is_final(self, path: Path) -> bool:
        hidden = any(part.startswith(".") for part in path.relative_to(self.root).parts)
        return path.is_file() and not hidden

    @invariant()
    def what_stands_is_whole(self, but: Path | None = None) -> None:
        for job in clip_jobs(CONFIG, self.bank):
            if job.folder.exists():
                record = json.loads((job.folder / CLIP_RECORD).read_text())
                found = {n: sha256_of(job.folder / f"{n}.npy") for n in ARRAYS}
                assert record["sha256"] == found
        if self.is_rendered:
            assert verify(self.bank) == ()
        if self.is_published:
            damaged = {self.place / file.object_name for file in verify_published(self.url)}
            assert damaged == ({but} if but else set())
        if self.place.exists():
            for path in (self.place / "objects").glob("[0-9a-f]*"):
                assert path == but or sha256_of(path) == path.name
        for path in fetched_banks().rglob("*"):
            if self.is_final(path):
                (name,) = path.relative_to(fetched_banks()).parts[:1]
                in_bank = self.bank / path.relative_to(fetched_banks() / name)
                assert not in_bank.exists() or path.read_bytes() == in_bank.read_bytes()

    @invariant()
    def nothing_is_lost_or_changed(self) -> None:
        found = {p: sha256_of(p) for p in self.root.rglob("*") if self.is_final(p)}
        assert self.stood.items() <= found.items()
        self.stood = found


TestStore = StoreMachine.TestCase
TestStore.settings = settings(
    max_examples=max(25, settings().max_examples // 100), stateful_step_count=15
)
