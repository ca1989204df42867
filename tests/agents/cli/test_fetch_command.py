"""`shotenv fetch`: what was published, byte for byte, over nothing."""

from __future__ import annotations

import uuid
from pathlib import Path

import pytest
from folder_contents import contents_of

from agents.cli.entry import main
from unwrap.storage.place import Place
from unwrap.storage.publishing import publish_contents, publish_part


@pytest.fixture
def source(tmp_path) -> Path:
    folder = tmp_path / "source"
    (folder / "short").mkdir(parents=True)
    (folder / "short" / "random-0.npz").write_bytes(b"numbers" * 100)
    (folder / "results.json").write_text("{}")
    return folder


@pytest.fixture
def url(source) -> str:
    place = Place(f"memory://{uuid.uuid4().hex}")
    part = publish_part(place, "study", "short/random-0", source, ["short/random-0.npz"])
    publish_contents(place, "study", [part], source, ["results.json"])
    return place.url


def test_all_files_come_and_what_stands_is_kept(url, source, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["fetch", url, "--out", str(out)]) == 0
    assert "study, 2 files, is in" in capsys.readouterr().out
    assert contents_of(out) == contents_of(source)
    (out / "results.json").unlink()
    kept = (out / "short" / "random-0.npz").stat().st_mtime_ns
    assert main(["fetch", url, "--out", str(out)]) == 0
    assert contents_of(out) == contents_of(source)
    assert (out / "short" / "random-0.npz").stat().st_mtime_ns == kept


def test_a_file_of_ones_own_is_not_written_over(url, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    (out / "results.json").write_text("[]")  # As long as what is published.
    assert main(["fetch", url, "--out", str(out)]) == 1
    assert "results.json is not what is published" in capsys.readouterr().err
    assert contents_of(out) == {"results.json": b"[]"}


def test_where_nothing_was_published_nothing_is_made(tmp_path, capsys):
    assert main(["fetch", f"memory://{uuid.uuid4().hex}", "--out", str(tmp_path / "out")]) == 1
    assert "holds no contents.json" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
