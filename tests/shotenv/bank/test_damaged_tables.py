"""What tells which bank a folder holds is damaged, or a clip has no record: named, not rendered."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from shotenv.bank import build as build_module
from shotenv.bank.build import build_bank
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.files import BankError, identity, read_manifest, verify
from shotenv.config import BankConfig
from unwrap.support import write_json


@pytest.fixture
def begun(tmp_path, sensor, monkeypatch):
    """Configuration and folder of a bank of which no clip stands; nothing renders."""
    config = BankConfig(name="tiny", sensor=sensor)
    write_json(tmp_path / "bank" / "source.json", identity(config))
    monkeypatch.setattr(build_module, "render_clips", lambda *_: pytest.fail("rendered"))
    return config, tmp_path / "bank"


def test_a_flipped_digit_of_a_configuration_is_found(tiny_bank, tmp_path):
    path = shutil.copytree(tiny_bank, tmp_path / "bank") / "manifest.json"
    content = json.loads(path.read_text())
    content["config"]["world"]["frame_rate_hz"] = 18.0
    write_json(path, content)
    with pytest.raises(BankError, match=r"manifest\.json is damaged \(not as it was written\)"):
        verify(path.parent)


def test_a_bank_of_before_there_were_digests_stays_valid(tiny_bank, tmp_path):
    path = shutil.copytree(tiny_bank, tmp_path / "bank") / "manifest.json"
    content = json.loads(path.read_text())
    del content["digest"]
    write_json(path, content)
    assert (
        read_manifest(path.parent) == read_manifest(Path(tiny_bank)) and verify(path.parent) == ()
    )


@pytest.mark.parametrize("damage", ["", "[]", "{", "\xff", '{"config": NaN}'])
def test_a_damaged_source_is_named(begun, damage):
    config, folder = begun
    (folder / "source.json").write_bytes(damage.encode("latin-1"))
    with pytest.raises(BankError, match=r"source\.json is damaged \(.+\); delete"):
        build_bank(config, folder)


def test_a_clip_without_its_record_is_named_before_anything_is_rendered(begun):
    config, folder = begun
    clip = clip_jobs(config, folder)[3].folder
    clip.mkdir(parents=True)
    (clip / "gray.npy").write_bytes(b"of somebody")
    with pytest.raises(BankError, match=f"{clip.name} holds no clip.json; delete it or move it"):
        build_bank(config, folder)
    assert (clip / "gray.npy").read_bytes() == b"of somebody"


def test_what_a_killed_writer_left_is_deleted(begun, monkeypatch):
    config, folder = begun
    left = folder / "clips" / f".{clip_jobs(config, folder)[0].name}.4711"
    left.mkdir(parents=True)
    (left / "gray.npy").write_bytes(b"half")
    seen = []
    monkeypatch.setattr(build_module, "render_clips", lambda *_: seen.append(left.exists()))
    monkeypatch.setattr(build_module, "clip_jobs", lambda *_: ())
    with pytest.raises(ValueError, match="clips"):  # A table of contents without any.
        build_bank(config, folder)
    assert seen == [False] and not left.exists()
