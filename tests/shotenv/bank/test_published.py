"""A bank on a place: byte for byte that of a folder, however it came there."""

from __future__ import annotations

import json
import os
import uuid
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from cut_off_places import CutOffFileSystem
from folder_contents import contents_of
from made_up_clips import write_made_up, write_made_up_bank

from shotenv.bank import published
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.files import (
    BankError,
    bank_folder,
    fetched_banks,
    read_manifest,
    verify,
    write_manifest,
)
from shotenv.bank.listing.contents import contents_at, contents_of as told_of
from shotenv.bank.opening import find_thinned, open_bank
from shotenv.bank.published import (
    build_published,
    finish_published,
    publish_bank,
    publish_clip,
    standing_clips,
    verify_published,
)
from shotenv.bank.thinned import ThinnedBank
from shotenv.config.bank import BankConfig
from shotenv.config.reader import merged
from unwrap.storage.place import Place, StorageError
from unwrap.storage.publishing import publish_contents, publish_part

HEIGHT, WIDTH, FRAMES = 24, 32, 2


@pytest.fixture(autouse=True)
def _own_cache(tmp_path, monkeypatch):
    """What one test has fetched stands for no other."""
    monkeypatch.setenv("SHOTENV_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def config(sensor) -> BankConfig:
    """Three clips of two frames."""
    small = {
        "camera": {"width": WIDTH, "height": HEIGHT},
        "world": {"frames_per_clip": FRAMES, "families": ["garage"]},
        **{"train_clips": 1, "validation_clips": 1, "test_clips": 1},
    }
    return merged(BankConfig(name="small", sensor=sensor), small)


@pytest.fixture
def url() -> str:
    return f"memory://{uuid.uuid4().hex}"


def render_to(url: str, config: BankConfig, scratch: Path, **changes: float) -> list[str]:
    """As rendering to a place does: what stands is left, each clip published."""
    standing, made = standing_clips(url, config), []
    for job in clip_jobs(config, scratch):
        if job.name not in standing:
            if not job.stands:
                write_made_up(job, **changes)
            publish_clip(url, job)
            made.append(job.name)
    finish_published(url, config)
    return made


def test_a_bank_rendered_to_a_place_is_byte_for_byte_that_of_a_folder(config, url, tmp_path):
    assert len(render_to(url, config, tmp_path / "scratch")) == 3
    bank = open_bank(url)
    written = contents_of(write_made_up_bank(config, tmp_path / "here"))
    fetched = contents_of(bank.folder)
    # What it is rendered from is told beside it, as in the cache folder.
    assert fetched.pop("source.json") and fetched.pop(".lock") == b""
    assert fetched == written
    assert bank.folder.is_relative_to(fetched_banks()) and verify(bank.folder) == ()
    assert verify_published(url) == ()
    assert torch.equal(bank.distance_m(torch.tensor([5])), bank.frame(5).exposure.distance_m)


def test_what_is_in_a_bank_is_told_without_its_arrays(config, url, full, thinned, tmp_path):
    render_to(url, config, tmp_path / "scratch")
    published = [(open_bank(write_made_up_bank(config, tmp_path / "here")), url)]
    for number, bank in enumerate((full, thinned)):
        publish_bank(bank, f"{url}/{number}")
        published.append((bank, f"{url}/{number}"))
    for bank, where in published:
        here, there = told_of(bank), contents_at(where)
        assert there.pop("folder") == where and there.pop("bytes") > 0.9 * here.pop("bytes")
        del here["folder"]
        assert there == here
    assert not fetched_banks().exists()


def test_an_opened_bank_is_fetched_once(config, tmp_path):
    CutOffFileSystem.reset(empty=True)
    url = "cutoff://banks/small"
    render_to(url, config, tmp_path / "scratch")
    folder = open_bank(url).folder
    CutOffFileSystem.reset()
    assert open_bank(url).folder == folder
    assert CutOffFileSystem.operations == 2  # The table of contents: its size and itself.


def test_rendering_that_breaks_anywhere_gives_the_same_bank(config, tmp_path):
    url, cuts = "cutoff://banks/small", 0
    whole = None
    while True:
        CutOffFileSystem.reset(fails_at=cuts + 1, empty=True)
        try:
            render_to(url, config, tmp_path / "scratch")
            break
        except StorageError:
            pass
        cuts += 1
        CutOffFileSystem.reset()
        with pytest.raises(StorageError, match=r"contents\.json"):
            open_bank(url)
        CutOffFileSystem.store.pop("/banks/small/contents.json", None)
        standing = standing_clips(url, config)
        made = render_to(url, config, tmp_path / "scratch")
        assert len(made) == 3 - len(standing)
        opened = open_bank(url)
        assert whole in (None, opened.folder)  # Named by what is in it.
        whole = opened.folder
    assert cuts > 20 and verify(whole) == ()


def test_clips_of_machines_with_other_last_bits_do_no_harm(config, url, tmp_path):
    first, *others = clip_jobs(config, tmp_path / "one")
    write_made_up(first)
    publish_clip(url, first)
    render_to(url, config, tmp_path / "two", last_bit=1e-7)
    opened = open_bank(url)
    assert verify(opened.folder) == ()
    # A straggler that publishes once more changes nothing of what is complete.
    write_made_up(replace(first, folder=tmp_path / "late" / first.name), last_bit=2e-7)
    publish_clip(url, replace(first, folder=tmp_path / "late" / first.name))
    assert open_bank(url).folder == opened.folder and verify_published(url) == ()
    assert len(others) == 2


def test_what_is_missing_or_another_bank_is_named(config, url, tmp_path):
    with pytest.raises(StorageError, match=r"holds no contents\.json: nothing was published"):
        open_bank(url)
    first = clip_jobs(config, tmp_path)[0]
    write_made_up(first)
    publish_clip(url, first)
    with pytest.raises(BankError, match="lacks 2 of 3 clips, such as 00001-garage"):
        finish_published(url, config)
    render_to(url, config, tmp_path / "scratch")
    other = merged(config, {"seed": 9})
    assert standing_clips(url, other) == frozenset()
    with pytest.raises(StorageError, match=f"holds {bank_folder(config).name}, not small-"):
        render_to(url, other, tmp_path / "other")


def test_a_place_that_cannot_be_written_is_refused_before_anything_is_rendered(
    config, monkeypatch, full
):
    def denied(*_, **__):
        raise PermissionError("Access Denied")

    CutOffFileSystem.reset(empty=True)
    monkeypatch.setattr(CutOffFileSystem, "pipe_file", denied)
    monkeypatch.setattr(published, "render_clips", lambda *_: pytest.fail("rendered"))
    monkeypatch.setattr(published, "publish_part", lambda *_, **__: pytest.fail("published"))
    for work in (build_published, publish_bank):
        with pytest.raises(StorageError, match=r"cannot write cutoff://denied/x.*Access Denied"):
            work(config if work is build_published else full, "cutoff://denied/x")


def test_a_damaged_record_of_a_clip_is_named(config, url, tmp_path):
    render_to(url, config, tmp_path / "scratch")
    place = Place(url)
    small = min(place.sizes("objects").items(), key=lambda item: item[1])
    record = place.read(small[0], most_bytes=10**6)
    place.write(small[0], record.replace(b"garage", b"barage"))
    with pytest.raises(BankError, match=r"the record of clip .* is damaged \(not as it was"):
        finish_published(url, config)
    with pytest.raises(StorageError, match="another SHA-256"):
        open_bank(url)
    [damaged] = verify_published(url)
    assert damaged.object_name == small[0] and damaged.path.endswith("/clip.json")


def test_banks_of_any_kind_are_published(config, url, full, thinned, tmp_path):
    for number, bank in enumerate((full, thinned)):
        where = f"{url}/{number}"
        publish_bank(bank, where)
        fetched = open_bank(where)
        assert type(fetched) is type(bank) and fetched.fingerprint == bank.fingerprint
        copy = contents_of(fetched.folder)
        assert copy.pop(".lock") == b"" and copy == contents_of(bank.folder)
    assert isinstance(find_thinned(f"{url}/1"), ThinnedBank) and find_thinned(f"{url}/0") is None
    # One that was rendered counts as its configuration's.
    stands = open_bank(write_made_up_bank(config, tmp_path / "here"))
    publish_bank(stands, f"{url}/2")
    assert len(standing_clips(f"{url}/2", config)) == 3


def test_a_fetched_bank_that_is_damaged_tells_its_own_cure(config, url, tmp_path):
    render_to(url, config, tmp_path / "scratch")
    folder = open_bank(url).folder
    (folder / "clips" / "00000-garage" / "active.npy").write_bytes(b"")
    with pytest.raises(BankError, match=f"delete {folder}, and it is fetched again"):
        open_bank(url)


def test_a_part_that_is_no_clip_is_named(config, url, tmp_path):
    """Who can write to the place may have put there what no rendering publishes."""
    render_to(url, config, tmp_path / "scratch")
    place, label = Place(url), bank_folder(config).name
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "manifest.json").write_text("{}")
    for names, under in (([], "clips/00000-garage"), (["manifest.json"], "")):
        (tmp_path / "other" / "clip.json").write_text("[]")
        publish_part(
            place, label, "00000-garage", tmp_path / "other", [*names, "clip.json"][:1], under=under
        )
        said = "lists what is no clip" if names else "record of clip 00000-garage, is damaged"
        with pytest.raises(BankError, match=said):
            finish_published(url, config)


@pytest.mark.parametrize("where", ["notes.txt", "clips/00000-garage/clip.json", "clips/more"])
def test_links_out_of_a_bank_are_not_published(config, url, tmp_path, where):
    """Whoever made the bank may have meant somebody's keys."""
    (tmp_path / "private").mkdir()
    (tmp_path / "private" / "key").write_text("secret")
    folder = write_made_up_bank(config, tmp_path / "here")
    (folder / where).unlink(missing_ok=True)
    (folder / where).symlink_to(tmp_path / "private" / ("" if where == "clips/more" else "key"))
    with pytest.raises(BankError, match=f"{where} leads to .*private.*, out of the bank"):
        publish_bank(open_bank(folder), url)
    assert Place(url).sizes("objects") == {}
    # Within it they are as good as copies.
    (folder / where).unlink()
    (folder / where).symlink_to(folder / "clips" / "00001-garage" / "clip.json")
    publish_bank(open_bank(folder), url)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("kind", ["a pipe", "a folder"])
def test_what_is_no_file_is_named_and_not_waited_for(config, url, tmp_path, kind):
    folder = write_made_up_bank(config, tmp_path / "here")
    odd = folder / "clips" / "00000-garage" / "odd"
    os.mkfifo(odd) if kind == "a pipe" else odd.mkdir()
    with pytest.raises(StorageError, match="odd cannot be published: not a regular file"):
        publish_bank(open_bank(folder), url)


@pytest.mark.parametrize("name", ["../../x", "/etc/x", "a\x1b[31m", "a\nb", ""])
def test_names_of_banks_are_no_paths_and_show_as_they_are(config, tmp_path, name):
    folder = write_made_up_bank(config, tmp_path / "here")
    records = read_manifest(folder).clips
    with pytest.raises(ValueError, match="name"):
        write_manifest(folder, name, records, (HEIGHT, WIDTH), config)
    told = json.loads((folder / "manifest.json").read_text()) | {"name": name}
    del told["digest"]
    (folder / "manifest.json").write_text(json.dumps(told))
    with pytest.raises(BankError, match=r"manifest\.json is damaged \(name"):
        open_bank(folder)


def test_what_is_no_bank_is_refused(url, tmp_path):
    (tmp_path / "notes.txt").write_text("no bank")
    publish_contents(Place(url), "notes", [], tmp_path, ["notes.txt"])
    with pytest.raises(BankError, match="holds notes, which is no bank"):
        open_bank(url)
