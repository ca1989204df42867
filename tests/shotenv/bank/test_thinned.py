"""Thinned banks: what is kept of the full frames, play on them, and damage found."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import pickle
import shutil

import numpy as np
import pytest
import torch

from agents.cli.entry import main
from shotenv.bank import thinned as thinned_file
from shotenv.bank.files.layout import BankError
from shotenv.bank.files.store import verify
from shotenv.bank.opening import open_bank
from shotenv.bank.thinned import FARTHEST_M, ThinnedBank, decode_light, encode_light
from shotenv.config.keywords import env_config
from shotenv.dataset.thinning import draw_positions
from shotenv.decision.acquire import acquire_depth
from shotenv.decision.drive import draw_drive
from shotenv.decision.problem import open_problem
from shotenv.decision.scenes import Scenes
from shotenv.sensor.acquisition import (
    acquire,
    incident_light,
    pixel_of,
    scored_pixels,
    sensitivity,
)
from shotenv.sensor.exposure import Exposure
from unwrap.signal import Shots, decode

EVERY = 4


def at_positions(maps: torch.Tensor, bank: ThinnedBank) -> torch.Tensor:
    rows, columns = np.array(bank.manifest.rows), np.array(bank.manifest.columns)
    return maps[..., rows, columns]


def problems(full, thinned, tiny_kwargs, **more):
    """The problem on the full bank and on the thinned one."""
    kwargs = {**tiny_kwargs, **more}
    return [open_problem(env_config(**{**kwargs, "bank": str(b.folder)})) for b in (full, thinned)]


def test_each_cell_gives_one_pixel_drawn_by_the_seed():
    rows, columns = draw_positions(24, 32, 4, seed=3)
    assert rows.shape == columns.shape == (6, 8)
    down, across = np.indices((6, 8))
    assert (rows // 4 == down).all() and (columns // 4 == across).all()
    assert len(np.unique(rows % 4)) == len(np.unique(columns % 4)) == 4
    again, other = (draw_positions(24, 32, 4, seed=seed)[0] for seed in (3, 4))
    assert (again == rows).all() and (other != rows).any()


def test_clips_splits_and_what_is_known_of_frames_are_the_full_banks(full, thinned):
    assert isinstance(open_bank(thinned.folder), ThinnedBank)
    assert (thinned.height, thinned.width, thinned.every) == (6, 8, EVERY)
    assert thinned.is_thinned and not full.is_thinned and full.every == 1
    assert thinned.clips == full.clips and len(thinned) == len(full)
    assert thinned.name == "small" and thinned.manifest.source == full.fingerprint
    assert thinned.config == full.config
    for name in ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s"):
        np.testing.assert_array_equal(getattr(thinned, name), getattr(full, name))
    frame = thinned.frame(5)
    assert frame.clip == full.clip_of(5) and frame.exposure.correlation.shape == (1, 8, 6, 8)


def test_light_is_the_full_banks_within_the_rounding_of_float16(full, thinned):
    frames = torch.tensor([0, 7, len(full) - 1])
    exact, kept = full.exposure(frames), thinned.exposure(frames)
    half = 2.0**-11
    for name in ("active", "ambient"):
        expected = at_positions(getattr(exact, name), thinned)
        np.testing.assert_allclose(getattr(kept, name), expected, rtol=1.01 * half)
    correlation = at_positions(exact.correlation, thinned)
    np.testing.assert_allclose(kept.correlation, correlation, rtol=1.01 * half, atol=1e-9)
    truth_m, kept_m = at_positions(exact.distance_m, thinned), thinned.distance_m(frames)
    assert torch.equal(truth_m.isinf(), kept_m.isinf()) and truth_m.isinf().any()
    hit = truth_m.isfinite()
    assert (truth_m[hit] - kept_m[hit]).abs().max() <= 0.51e-3
    assert torch.equal(thinned.gray(frames), at_positions(full.gray(frames), thinned))
    assert kept.correlation.dtype == kept_m.dtype == torch.float32


def made_light(active: np.ndarray, seed: int = 0) -> dict[str, np.ndarray]:
    """Light of pixels with these active radiances, [1, H, W], at random phases."""
    phase = np.random.default_rng(seed).uniform(0, 2 * math.pi, active.shape)
    cosines = [np.cos(phase - k * math.pi / 2) for k in range(8)]
    return {
        "correlation": (active[:, None] * np.stack(cosines, axis=1)).astype(np.float32),
        "active": active.astype(np.float32),
        "ambient": active.astype(np.float32),
        "distance_m": np.full(active.shape, 3.0, np.float32),
        "gray": np.zeros(active.shape, np.uint16),
    }


def test_nothing_underflows_eight_decades_below_the_brightest_pixel():
    """Below 6e-5 a float16 loses its bits; the light of a night is 1e-6 and less."""
    maps = made_light(np.geomspace(2e-7, 20.0, 400).reshape(1, 20, 20))
    stored, units = encode_light(maps)
    light = decode_light({n: stored[n] for n in stored if n != "gray"}, **units)
    np.testing.assert_allclose(light.active, maps["active"], rtol=5e-4)
    np.testing.assert_allclose(light.ambient, maps["ambient"], rtol=5e-4)
    assert max(np.abs(stored[name]).max() for name in ("active", "ambient")) <= 2.0**15
    assert math.log2(units["active_unit"]).is_integer()


def test_phases_err_far_less_than_the_best_pixel_is_noisy(sensor):
    """Best: four samples of full wells, whose shot noise alone is 1.5 mrad."""
    maps = made_light(np.geomspace(1e-6, 20.0, 3600).reshape(1, 60, 60))
    stored, units = encode_light(maps)
    light = decode_light({n: stored[n] for n in stored if n != "gray"}, **units)
    exact = decode(torch.from_numpy(maps["correlation"][0, :4])).phase_rad
    error = decode(light.correlation[0, :4]).phase_rad - exact
    error = (error + math.pi) % (2 * math.pi) - math.pi
    rms = float(error.square().mean().sqrt())
    # N electrons a sample, amplitude m N: D0 - D2 has the noise sqrt(2 N) on 2 m N.
    electrons = 2 * sensor.full_well_e
    best_noise_rad = 1.0 / (sensor.contrast * math.sqrt(2.0 * electrons))
    assert rms < 0.12 * best_noise_rad
    assert float(error.abs().max()) < 0.5 * best_noise_rad


def test_light_on_dark_pixels_and_beyond_the_range_is_kept():
    maps = made_light(np.array([[[0.0, 1.0, 0.5, 0.25]]]))
    maps["distance_m"] = np.array([[[np.inf, 500.0, 0.0, 12.34567]]], np.float32)
    stored, units = encode_light(maps)
    light = decode_light({n: stored[n] for n in stored if n != "gray"}, **units)
    assert (light.correlation[0, :, 0, 0] == 0).all() and light.active[0, 0, 0] == 0
    expected = [math.inf, FARTHEST_M, 0.0, 12.346]
    assert light.distance_m[0, 0].tolist() == pytest.approx(expected)


def test_predictions_and_scene_features_are_those_of_the_full_frames(full, thinned, tiny_kwargs):
    whole, small = problems(full, thinned, tiny_kwargs, split="test")
    frames = full.frames("test")
    predicted_m = at_positions(whole.kept.distance_of(frames), thinned)
    assert torch.equal(small.kept.distance_of(frames), predicted_m)
    for field in dataclasses.fields(Scenes):
        exact, kept = getattr(whole.scenes, field.name), getattr(small.scenes, field.name)
        assert torch.equal(kept[frames], exact[frames])
        # NaN in other splits on both.
        assert torch.equal(kept.isnan(), exact.isnan()) and kept.isnan().any()
    assert small.network_work == whole.network_work
    assert small.fusion is None and small.clips == whole.clips


def test_two_openings_give_the_same_bits(thinned):
    frames = torch.arange(len(thinned))
    first = thinned.exposure(frames)
    thinned_file._opened.cache_clear()
    again = ThinnedBank(thinned.folder).exposure(frames)
    for field in dataclasses.fields(Exposure):
        assert torch.equal(getattr(first, field.name), getattr(again, field.name))


def test_another_process_opens_the_same_bank(thinned):
    again = pickle.loads(pickle.dumps(thinned))
    assert again.fingerprint == thinned.fingerprint and again.clips == thinned.clips


def test_a_frame_is_acquired_as_the_full_banks_pixels_are(full, thinned, tiny_kwargs):
    """Same offsets, same noise: samples differ by the rounding of the light alone."""
    whole, small = problems(full, thinned, tiny_kwargs, split="test")
    drive = draw_drive(11, small.config, small.clips, 6, 8, network=small.network_work)
    step = torch.tensor([4])
    noise = [torch.randn(1, 2, 6, 8, generator=torch.Generator().manual_seed(k)) for k in range(8)]
    found = acquire_depth(small, drive, step, Shots.EIGHT, noise=noise)

    exposure, sensor = whole.bank.exposure(drive.frame(step)), whole.config.sensor
    pixels = [
        at_positions(getattr(exposure, f.name), thinned) for f in dataclasses.fields(exposure)
    ]
    light = incident_light(
        Exposure(*pixels), sensitivity(sensor, drive.laser_power_w, drive.integration_s)
    )
    raw = acquire(light, sensor, shots=Shots.EIGHT, noise=noise, offsets=drive.offsets)
    apart = (found.raw.dcs_lsb - raw.dcs_lsb).abs()
    # A word may round the other way; 2 LSB of at most 2048 are what float16 leaves of the light.
    assert apart.max() <= 2 and (apart > 0).float().mean() < 0.3
    read_noise_lsb = math.sqrt(2) * pixel_of(sensor).gain_lsb_per_e * sensor.read_noise_e
    assert apart.square().mean().sqrt() < 0.5 * read_noise_lsb
    scored = scored_pixels(light, pixels[3], sensor)
    assert (scored != found.scored).sum() <= 1 and found.scored.any()
    predicted_m = at_positions(whole.kept.distance_of(drive.frame(step)), thinned)
    assert torch.equal(found.predicted_m, predicted_m)


def test_energies_are_those_of_the_full_sensor(full, thinned, tiny_kwargs):
    whole, small = problems(full, thinned, tiny_kwargs, split="test")
    costs = [
        draw_drive(5, p.config, p.clips, p.bank.height, p.bank.width, network=p.network_work)
        for p in (whole, small)
    ]
    assert torch.equal(costs[0].always_eight.energy_j, costs[1].always_eight.energy_j)


def flip_a_byte(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def rename_a_family(path):
    path.write_text(path.read_text().replace("garage", "gerage"))


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("arrays.npz", flip_a_byte),
        ("arrays.npz", lambda path: path.unlink()),
        ("arrays.npz", lambda path: path.write_bytes(b"")),
        ("thinned.json", rename_a_family),
        ("thinned.json", lambda path: path.write_text("{")),
    ],
)
def test_damage_is_found_at_opening_by_name(thinned, tmp_path, capsys, name, damage):
    folder = shutil.copytree(thinned.folder, tmp_path / "damaged")
    damage(folder / name)
    with pytest.raises(BankError, match=f"{name} is (missing or )?damaged.*; thin the bank again"):
        open_bank(folder)
    assert main(["bank", "verify", str(folder)]) == 1
    assert f"{name} is " in capsys.readouterr().err


def test_a_file_of_gigabytes_is_refused_before_its_digest_is_taken(thinned, tmp_path, monkeypatch):
    folder = shutil.copytree(thinned.folder, tmp_path / "swollen")
    os.truncate(folder / "arrays.npz", 3 << 30)
    monkeypatch.setattr(thinned_file, "sha256_of", lambda path: pytest.fail("read"))
    with pytest.raises(BankError, match=r"arrays.npz is missing or damaged"):
        ThinnedBank(folder)


def test_a_whole_bank_passes_verify(thinned, capsys):
    assert verify(thinned.folder) == ()
    assert main(["bank", "verify", str(thinned.folder)]) == 0
    assert "every file is as it was written" in capsys.readouterr().out


def test_thin_and_info_on_the_command_line(tiny_bank, tiny_unwrapper, tmp_path, capsys):
    folder, about = tmp_path / "few", tmp_path / "about.json"
    words = ["bank", "thin", tiny_bank, "--every", "8", "--out", folder, "--name", "few-pixels"]
    assert main([str(word) for word in (*words, "--networks", tiny_unwrapper)]) == 0
    assert main(["bank", "info", str(folder), "--json", str(about)]) == 0
    found, out = json.loads(about.read_text()), capsys.readouterr().out
    assert "few-pixels: 64 frames of 4 x 3 pixels in 16 clips" in out
    assert "a pixel of each 8 x 8 of tiny" in out
    assert found["bytes"] == sum(path.stat().st_size for path in folder.iterdir())
    assert found["thinned"]["every"] == 8
    assert main(["bank", "info", str(folder), "--sheet", str(tmp_path / "sheet.png")]) == 1
    assert "a contact sheet needs neighbours" in capsys.readouterr().err
