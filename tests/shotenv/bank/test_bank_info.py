"""`shotenv bank`: what it tells, what it refuses, and the pictures on a contact sheet."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from PIL import Image

from agents.cli.entry import main
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.files.folders import bank_folder
from shotenv.bank.files.layout import BankError
from shotenv.bank.listing.contact_sheets import (
    clips_by_family,
    clips_shown,
    color_maps,
    contact_sheet,
    maps_of,
)
from shotenv.bank.listing.contents import known_banks
from shotenv.bank.opening import open_bank
from shotenv.config.bank import BankConfig
from shotenv.config.families import FAMILIES
from shotenv.config.reader import find_config, read_config
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.support.files import write_json


def run(capsys, *words):
    status = main([str(word) for word in words])
    out, err = capsys.readouterr()
    return status, out, err


def test_without_a_name_every_known_bank_is_listed(capsys, tmp_path):
    path = tmp_path / "banks.json"
    status, out, _ = run(capsys, "bank", "info", "--json", path)
    banks = {bank["name"]: bank for bank in json.loads(path.read_text())}
    assert status == 0 and set(banks) >= {"nearfield", "starter", "training"}
    assert banks["nearfield"]["frames"] == 2048 and not banks["nearfield"]["rendered"]
    assert all(name in out for name in banks)


def test_clips_that_stand_are_counted():
    config = read_config(BankConfig, find_config("bank", "nearfield"))
    job = clip_jobs(config, bank_folder(config))[3]
    job.folder.mkdir(parents=True)
    (job.folder / "clip.json").touch()
    bank = next(bank for bank in known_banks() if bank["name"] == "nearfield")
    assert bank["clips_standing"] == 1 and not bank["rendered"]
    assert 0 < bank["minutes_left"] < 24 * 60
    with pytest.raises(BankError, match="1 of 512 clips stand"):
        open_bank("nearfield", render=False)
    shutil.rmtree(bank_folder(config))


def test_asking_about_a_bank_never_renders_it(capsys):
    for command in ("info", "verify"):
        status, out, err = run(capsys, "bank", command, "nearfield")
        assert status == 1 and out == "" and err.count("\n") == 1
        assert "not rendered yet" in err and "shotenv render --config" in err


def test_info_tells_frames_of_each_family_and_split(capsys, tiny_bank, tmp_path):
    path = tmp_path / "bank.json"
    status, out, _ = run(capsys, "bank", "info", tiny_bank, "--json", path)
    about, bank = json.loads(path.read_text()), open_bank(tiny_bank)
    assert status == 0
    for split, counts in about["splits"].items():
        assert sum(counts.values()) == len(bank.frames(split))
        assert set(counts) == set(FAMILIES)
    files = bank.folder.glob("clips/*/*.npy")
    headers = 128 * 5 * about["clips"]
    assert about["bytes"] == sum(file.stat().st_size for file in files) - headers
    assert BankConfig(**about["config"]) == bank.config
    assert "epc660, 24 and 10 MHz" in out


def test_sheet_is_written_as_a_png(capsys, tiny_bank, tmp_path):
    path = tmp_path / "sheets" / "tiny.png"
    status, out, _ = run(capsys, "bank", "info", tiny_bank, "--sheet", path, "--clips", 2)
    assert status == 0 and str(path) in out
    with Image.open(path) as image:
        image.load()
        assert image.format == "PNG" and image.width > 8 * 160


def test_no_clips_on_a_sheet_are_refused(capsys, tiny_bank):
    status, _, err = run(capsys, "bank", "info", tiny_bank, "--clips", 0)
    assert status == 2 and "clips: 0; expected above 0" in err


def test_each_split_is_shown_before_a_second_clip_of_any(tiny_bank):
    families = clips_by_family(open_bank(tiny_bank))
    assert list(families) == list(FAMILIES)
    for clips in families.values():
        assert [clip.split for clip in clips_shown(clips, 3)] == ["train", "validation", "test"]
        assert clips_shown(clips, 100) == clips


def test_the_true_distance_is_on_the_sheet_once_in_its_colours(tiny_bank):
    bank = open_bank(tiny_bank)
    pixels = np.asarray(contact_sheet(bank, clips=1))
    distance_m = maps_of(bank, bank.clips[0].frames // 2)["distance"]
    colors = color_maps(bank)["distance"]
    near = np.clip(distance_m / colors.high * 254, 0, 254).round()
    expected = colors.palette[np.where(np.isfinite(distance_m), near, 255).astype(int)]
    enlarged = np.kron(expected, np.ones((5, 5, 1), int))
    corners = np.argwhere((pixels == enlarged[-1, -1]).all(-1)) + 1
    tiles = (pixels[max(b - 120, 0) : b, max(r - 160, 0) : r] for b, r in corners)
    assert sum(np.array_equal(tile, enlarged) for tile in tiles) == 1


def test_quantities_agree_with_each_other(tiny_bank):
    """Noise-free, near rest and but for the wiggle, wrapped distance is distance modulo d_u."""
    bank = open_bank(tiny_bank)
    sensor, still = bank.config.sensor, np.flatnonzero(bank.ego_speed_m_s == 0)
    index = int(still[0]) if len(still) else int(np.argmin(bank.ego_speed_m_s))
    moved_m = 8 * sensor.sample_period_s * float(bank.ego_speed_m_s[index]) * 0.1
    found, wrap_m = maps_of(bank, index), unambiguous_range_m(sensor.f1_hz)
    lit = np.isfinite(found["wrapped distance"]) & np.isfinite(found["distance"])
    error = (found["wrapped distance"] - found["distance"] + wrap_m / 2) % wrap_m - wrap_m / 2
    wiggle_m = 0.09 * sensor.harmonic_strength * wrap_m / (2 * np.pi)  # 0.0711 rad if square
    assert lit.mean() > 0.5 and np.abs(error[lit]).max() < moved_m + wiggle_m + 1e-3
    light = bank.frame(index).exposure.active[0].numpy()
    overtones = sensor.harmonic_strength * (np.pi**2 / 8 - 1)  # sum of 1 / h^2, h = 3, 5, ...
    np.testing.assert_allclose(10 ** found["amplitude"][lit], light[lit], rtol=0.01 + overtones)


def test_an_imported_bank_has_no_sheet(tmp_path, tiny_bank):
    folder = shutil.copytree(tiny_bank, tmp_path / "bank")
    manifest = json.loads((folder / "manifest.json").read_text())
    del manifest["digest"]
    write_json(folder / "manifest.json", {**manifest, "config": None})
    with pytest.raises(BankError, match="nothing tells its frequencies"):
        contact_sheet(open_bank(folder))


def damage_record(folder):
    path = folder / "clip.json"
    path.write_text(path.read_text().replace("garage", "gerage"))
    return path


def damage_array(folder):
    path = folder / "active.npy"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    return path


def remove_record(folder):
    (folder / "clip.json").unlink()
    return folder / "clip.json"


@pytest.mark.parametrize("damage", [damage_record, damage_array, remove_record])
def test_verify_names_the_damaged_file(capsys, tiny_bank, tmp_path, damage):
    folder = shutil.copytree(tiny_bank, tmp_path / "bank")
    path = damage(folder / "clips" / "002-garage")
    status, out, err = run(capsys, "bank", "verify", folder, "--json", tmp_path / "found.json")
    assert status == 1 and out == "" and err.count("is damaged") == 1
    assert f"{path} is damaged; delete {path.parent}" in err
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["damaged"] == [str(path.relative_to(folder))]
