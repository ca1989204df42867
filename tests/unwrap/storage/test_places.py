"""Places: published whole or not at all, whatever breaks in between; damage is named."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from cut_off_places import CutOffFileSystem
from folder_contents import contents_of

from unwrap.storage import publishing
from unwrap.storage.fetching import damaged_files, fetch
from unwrap.storage.listing import Listing, StoredFile
from unwrap.storage.place import Place, StorageError, is_url
from unwrap.storage.publishing import (
    publish_contents,
    publish_part,
    read_contents,
    standing_parts,
)

PARTS = ("one", "two")


@pytest.fixture
def source(tmp_path) -> Path:
    """Two parts of two files each, of which one is in both; a file of its own besides."""
    folder = tmp_path / "source"
    for part in PARTS:
        (folder / part).mkdir(parents=True)
        (folder / part / "own.bin").write_bytes(part.encode() * 500)
        (folder / part / "same.bin").write_bytes(bytes(range(256)))
    (folder / "table.json").write_text('{"parts": 2}')
    return folder


@pytest.fixture(params=["memory", "file"])
def url(request, tmp_path) -> str:
    if request.param == "file":
        return f"file://{tmp_path}/place"
    return f"memory://{uuid.uuid4().hex}"


def publish(place: Place, source: Path) -> Listing:
    parts = [publish_part(place, "thing", p, source / p, under=p) for p in PARTS]
    return publish_contents(place, "thing", parts, source, ["table.json"])


def test_what_is_published_is_fetched_byte_for_byte(url, source, tmp_path):
    place = Place(url)
    publish(place, source)
    assert set(standing_parts(place, "thing")) == set(PARTS)
    ticks: list[int] = []
    listing = read_contents(place)
    fetch(place, listing, tmp_path / "fetched", tick=ticks.append)
    assert contents_of(tmp_path / "fetched") == contents_of(source)
    assert sum(ticks) == listing.total_bytes == sum(map(len, contents_of(source).values()))
    assert damaged_files(place, listing) == ()
    # An object for each content, not for each file.
    assert len(place.sizes("objects")) == len(set(contents_of(source).values()))


def test_publishing_that_breaks_anywhere_is_never_taken_for_done(source, tmp_path):
    """The n-th operation fails, half way where it writes; nothing is asked any more; for all n."""
    url, cuts = "cutoff://shelf", 0
    while True:
        CutOffFileSystem.reset(fails_at=cuts + 1, empty=True)
        try:
            publish(Place(url), source)
            break
        except StorageError as error:
            assert "connection lost" in str(error) and url in str(error)
        cuts += 1
        CutOffFileSystem.reset()
        place = Place(url)
        # Parts that count as whole are whole, and nothing counts as complete.
        for part, listing in standing_parts(place, "thing").items():
            fetch(place, listing, tmp_path / f"part{cuts}")
            assert contents_of(tmp_path / f"part{cuts}" / part) == contents_of(source / part)
        with pytest.raises(StorageError, match=r"contents\.json"):
            read_contents(place)
        if place.size("contents.json") is not None:
            del CutOffFileSystem.store["/shelf/contents.json"]  # The cure that the message names.
        # The same command again makes it whole, and uploads no object that was whole.
        whole = {
            f"/shelf/{name}"
            for name, size in place.sizes("objects").items()
            if any(size == f.bytes and f.object_name == name for f in listed(source))
        }
        CutOffFileSystem.reset()
        publish(place, source)
        assert not whole & set(CutOffFileSystem.uploads)
        fetch(place, read_contents(place), tmp_path / f"whole{cuts}")
        assert contents_of(tmp_path / f"whole{cuts}") == contents_of(source)
    # Each object is asked for and written; so are two listings, and the contents asked for.
    assert cuts >= 10


def listed(source: Path) -> list[StoredFile]:
    return [
        StoredFile(path=path, sha256=hashlib.sha256(content).hexdigest(), bytes=len(content))
        for path, content in contents_of(source).items()
    ]


def test_fetching_that_breaks_anywhere_is_continued(source, tmp_path):
    CutOffFileSystem.reset(empty=True)
    place, cuts = Place("cutoff://fetched"), 0
    listing = publish(place, source)
    while True:
        fetched = tmp_path / f"fetched{cuts}"
        CutOffFileSystem.reset(fails_at=cuts + 1)
        try:
            fetch(place, listing, fetched)
            break
        except StorageError as error:
            assert "connection lost" in str(error)
        # What has its name is what was published, and the table comes last.
        for path, content in contents_of(fetched).items():
            assert content == (source / path).read_bytes()
        assert not (fetched / "table.json").exists()
        there = len(contents_of(fetched))
        CutOffFileSystem.reset()
        fetch(place, listing, fetched)
        assert contents_of(fetched) == contents_of(source)
        # Two operations for each file that was not there yet.
        assert CutOffFileSystem.operations == 2 * (len(listing.files) - there)
        cuts += 1
    assert cuts == 2 * len(listing.files)


def test_two_writers_of_a_part_do_no_harm_also_when_their_bytes_differ(url, source, tmp_path):
    """As two machines whose last bits differ: whoever is last is named, and whole."""
    place, other = Place(url), tmp_path / "other"
    first = publish_part(place, "thing", "one", source / "one", under="one")
    other.mkdir()
    (other / "own.bin").write_bytes(b"One" * 500)
    (other / "same.bin").write_bytes(bytes(range(256)))
    second = publish_part(place, "thing", "one", other, under="one")
    assert standing_parts(place, "thing") == {"one": second}
    # What was complete by then keeps to what it named.
    for listing, made in ((first, source / "one"), (second, other)):
        fetched = tmp_path / listing.digest
        fetch(place, listing, fetched)
        assert contents_of(fetched / "one") == contents_of(made)


def test_writers_at_the_same_time_end_with_one_whole(url, source, tmp_path):
    with ThreadPoolExecutor(4) as pool:
        done = list(pool.map(lambda _: publish(Place(url), source), range(8)))
    assert len(set(done)) == 1
    fetch(Place(url), read_contents(Place(url)), tmp_path / "fetched")
    assert contents_of(tmp_path / "fetched") == contents_of(source)


def test_another_thing_is_not_written_over(url, source):
    place = Place(url)
    publish(place, source)
    with pytest.raises(StorageError, match="holds thing, not other; choose another place"):
        publish_contents(place, "other", [], source, ["table.json"])
    assert standing_parts(place, "other") == {}
    assert read_contents(place).label == "thing"


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda content: content[:-1] + b"x", "has another SHA-256; delete it"),
        (lambda content: content[:-1], "bytes, expected"),
        (lambda content: content + b"x", "bytes, expected"),
        (None, "is missing; publish it again"),
    ],
)
def test_damaged_objects_are_named_and_never_come_to_their_name(
    url, source, tmp_path, change, said
):
    place = Place(url)
    listing = publish(place, source)
    damaged = listing.files[2]
    files, path = place._files, place._path(damaged.object_name)
    content = files.cat_file(path)
    files.rm_file(path)
    if change is not None:
        place.write(damaged.object_name, change(content))
    with pytest.raises(StorageError, match=said) as refusal:
        fetch(place, listing, tmp_path / "fetched")
    assert damaged.sha256 in str(refusal.value) and damaged.path in str(refusal.value)
    assert not (tmp_path / "fetched" / damaged.path).exists()
    assert list((tmp_path / "fetched").rglob(".*")) == []
    assert damaged_files(place, listing) == (damaged,)
    if (change is not None and len(change(content)) != len(content)) or change is None:
        assert listing.files[2].path.split("/")[0] not in standing_parts(place, "thing")


def test_a_listing_that_is_not_as_it_was_written_is_refused(url, source):
    place = Place(url)
    publish(place, source)
    written = place.read("contents.json", most_bytes=10**6)
    for changed in (written[:-20], written.replace(b"one/own", b"one/0wn"), b"[" * 10**5, b"[1]"):
        place.write("contents.json", changed)
        with pytest.raises(StorageError, match=r"contents\.json is damaged .*delete it"):
            read_contents(place)
    place.write("parts/thing/one.json", written[:100])
    assert set(standing_parts(place, "thing")) == {"two"}


@pytest.mark.parametrize(
    "path", ["../x", "/etc/x", "a/../../x", "a//x", ".hidden", "a/.hidden", "a\\..\\x", "a/x\n", ""]
)
def test_paths_that_leave_the_folder_are_refused(path):
    file = {"path": path, "sha256": "0" * 64, "bytes": 1}
    content = {"schema_version": 1, "label": "x", "files": [file]}
    digest = hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
    with pytest.raises(ValueError, match="path"):
        Listing.decoded(json.dumps({**content, "digest": digest}).encode())


def test_sizes_are_limited_before_anything_is_read(url, source, monkeypatch, tmp_path):
    place = Place(url)
    listing = publish(place, source)
    with pytest.raises(StorageError, match=r"contents\.json has \d+ bytes; expected at most 10"):
        place.read("contents.json", most_bytes=10)
    monkeypatch.setattr(publishing, "LARGEST_JSON_BYTES", 300)
    assert standing_parts(place, "thing") == {}
    huge = listing.files[0].model_copy(update={"bytes": 2**40})
    free = SimpleNamespace(free=10**9)
    monkeypatch.setattr("unwrap.storage.fetching.shutil.disk_usage", lambda place: free)
    with pytest.raises(StorageError, match=r"needs 1099\.51 GB .* free"):
        fetch(place, Listing(label="x", files=(huge,)), tmp_path / "fetched")


def test_a_missing_backend_is_one_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "adlfs", None)
    with pytest.raises(StorageError, match="unknown://x is no place: Protocol not known"):
        Place("unknown://x")
    with pytest.raises(StorageError, match=r"abfs://x/y needs a package .* adlfs"):
        Place("abfs://x/y")
    code = (
        "import sys; sys.modules['fsspec'] = None\n"
        "from unwrap.storage import Place, StorageError\n"
        "try: Place('s3://b/x')\n"
        "except StorageError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == (
        "s3://b/x needs the package fsspec; `pip install 'shotenv[scale]'` brings it"
    )


@pytest.mark.parametrize(
    "url",
    [
        *("s3://key:secret@shelf/x", "s3://key:a/secret@shelf/x", "s3://key:a@secret@shelf"),
        *("memory://:secret@shelf", "https://host/x?token=secret", "abfs://x/y?sig=secret#z"),
    ],
)
def test_passwords_in_urls_are_refused_and_never_shown(url):
    with pytest.raises(StorageError, match="has a password or a question in it") as refusal:
        Place(url)
    assert "secret" not in str(refusal.value) and url.partition("://")[0] in str(refusal.value)


def test_users_and_colons_in_paths_are_welcome(tmp_path):
    assert Place("memory://container@account/x").url == "memory://container@account/x"
    place = Place(f"file://{tmp_path}/12:30@lab?")
    place.write("note", b"x")
    assert (tmp_path / "12:30@lab?" / "note").read_bytes() == b"x"


def test_chained_urls_are_refused(tmp_path):
    """A file that lies at one of them could name any other file to be read."""
    secret, names = tmp_path / "secret", tmp_path / "names.json"
    secret.write_text("secret")
    names.write_text(json.dumps({"version": 1, "refs": {"contents.json": [f"file://{secret}"]}}))
    with pytest.raises(StorageError, match="made of several; expected one URL"):
        Place(f"reference::file://{names}").read("contents.json", most_bytes=100)


def test_a_backend_that_fails_at_once_is_one_sentence():
    with pytest.raises(StorageError, match=r"ftp://127\.0\.0\.1:1/x is no place: .*refused"):
        Place("ftp://127.0.0.1:1/x")


def test_nothing_is_made_of_a_bucket_that_is_missing(monkeypatch):
    """As s3fs and gcsfs answer; asked to make its folders they would make the bucket."""
    made = []

    def missing(_, path, value, **__):
        raise FileNotFoundError("The specified bucket does not exist")

    monkeypatch.setattr(CutOffFileSystem, "pipe_file", missing)
    monkeypatch.setattr(CutOffFileSystem, "makedirs", lambda *_, **__: made.append(1))
    with pytest.raises(StorageError, match="cannot write cutoff://misspelt/x/a"):
        Place("cutoff://misspelt/x").write("a", b"")
    assert made == []


def test_urls_are_told_from_names_and_paths():
    for text in ("s3://b", "file:///x", "simplecache::s3://b/x", "git+ssh://x"):
        assert is_url(text)
    for text in ("pocket", "/a/b", "a/b", "C:\\x", Path("s3://b"), "", "://x"):
        assert not is_url(text)


def test_a_full_disk_leaves_nothing(source, tmp_path, monkeypatch):
    place = Place(f"file://{tmp_path}/place")

    def no_space(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("unwrap.support.files.os.fsync", no_space)
    with pytest.raises(StorageError, match=r"cannot write file://.*No space left"):
        publish(place, source)
    assert [path for path in (tmp_path / "place").rglob("*") if path.is_file()] == []


def test_pipes_and_devices_on_a_local_place_are_no_files(source, tmp_path):
    """Opening one would wait, or read, for ever."""
    place = Place(f"file://{tmp_path}/place")
    listing = publish_part(place, "thing", "one", source / "one")
    parts = tmp_path / "place" / "parts" / "thing"
    os.mkfifo(parts / "pipe.json")
    (parts / "device.json").symlink_to("/dev/zero")
    (parts / "nowhere.json").symlink_to(tmp_path / "nowhere")
    (parts / "link.json").symlink_to(parts / "one.json")
    assert sorted(place.sizes("parts")) == ["parts/thing/link.json", "parts/thing/one.json"]
    assert place.read("parts/thing/pipe.json", most_bytes=100) is None
    assert standing_parts(place, "thing") == {"one": listing, "link": listing}
