"""What follows where little is told: settings, seeds, speeds, all files of a folder."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import yaml
from word_banks import CAMERA

from shotenv.config.reader import find_config, read_config
from shotenv.config.sensor import SensorConfig
from shotenv.decision.drive import chain_recorded
from unwrap.signal.shots import Shots

FRAMES, SIZE = 5, (6, 8)


def write_plain(
    folder, *, count=2, frequencies="[24.0e+6, 10.0e+6]", planes=8, camera=CAMERA, **told
):
    """Recordings that store little more than samples, and what is told of all of them."""
    (folder / "camera").mkdir(parents=True)
    (folder / "camera" / "bench.yaml").write_text(f"{camera}frequencies_hz: {frequencies}\n")
    random = np.random.default_rng(1)
    for number in range(count):
        np.savez(
            folder / f"file{number}.npz",
            dcs=random.integers(-900, 900, (FRAMES, planes, *SIZE)).astype(np.int16),
            gray=random.integers(0, 4095, (FRAMES, *SIZE)).astype(np.uint16),
        )
    content = {
        "frame_rate_hz": 4.0,
        "laser_power_w": 6.0,
        "integration_s": 5e-4,
        "temperature_k": 318.15,
        "gray_exposure_s": 2e-3,
        **told,
    }
    (folder / "recordings.yaml").write_text(yaml.safe_dump(content))
    return folder


def test_all_files_of_a_folder_are_taken_with_what_is_told_of_all(take_in, tmp_path):
    (write_plain(tmp_path / "in") / "camera" / "note").mkdir()
    bank = take_in(tmp_path / "in", tmp_path / "out")
    assert [clip.name for clip in bank.clips] == ["000-file0", "001-file1"]
    assert [clip.seed for clip in bank.clips] == [0, 1]
    assert {clip.family for clip in bank.clips} == {"recorded"}
    assert bank.truth_level == "own" and bank.answers == tuple(Shots)
    assert bank.time_s.tolist() == [0.25 * (number % FRAMES) for number in range(2 * FRAMES)]
    assert not bank.ego_speed_m_s.any() and (bank.gray_exposure_s == 2e-3).all()
    assert not bank.settings(bank.clips[0]).offset_lsb.any()
    config = yaml.safe_load((tmp_path / "out" / "env.yaml").read_text())
    assert (config["split"], config["frames_per_drive"]) == ("test", FRAMES - 1)
    assert config["frame_rate_hz"] == 4.0


def test_ambient_and_drift_follow_from_the_imagers_temperature(take_in, tmp_path):
    bank = take_in(write_plain(tmp_path / "in"), tmp_path / "out")
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    own = bank.settings(bank.clips[0])
    assert own.ambient_k == pytest.approx(318.15 - sensor.self_heating_k)
    # 20 K above the calibration, 12.5 mm each, of which the sensor knows 95 %.
    assert own.shift_m == pytest.approx(-0.95 * 20 * 12.5e-3)


def test_four_samples_answer_two_and_four(take_in, tmp_path):
    folder = write_plain(tmp_path / "in", frequencies="[24.0e+6]", planes=4)
    bank = take_in(folder, tmp_path / "out")
    assert bank.answers == (Shots.TWO, Shots.FOUR) and bank.truth_level == "none"
    with pytest.raises(ValueError, match="truth is 'own', but recordings have 4 samples"):
        take_in(folder, tmp_path / "other", truth="own")


def test_of_three_frequencies_those_of_the_sensor_are_kept(take_in, tmp_path):
    folder = write_plain(
        tmp_path / "in", count=1, frequencies="[10.0e+6, 16.0e+6, 24.0e+6]", planes=12
    )
    bank = take_in(folder, tmp_path / "out")
    raw = bank.words(torch.arange(FRAMES), Shots.EIGHT).dcs_lsb.numpy()
    with np.load(folder / "file0.npz") as file:
        planes = file["dcs"]
    assert np.array_equal(raw[:, :4], planes[:, 8:]) and np.array_equal(raw[:, 4:], planes[:, :4])


def test_samples_made_of_phasors_are_kept_as_they_are_and_told(take_in, tmp_path):
    camera = CAMERA.replace("[0, 90, 180, 270]", "[0, 120, 240]")
    folder = write_plain(tmp_path / "in", count=1, planes=6, camera=camera)
    bank = take_in(folder, tmp_path / "out")
    assert bank.manifest.made and bank.manifest.words == "float32"
    raw = bank.words(torch.arange(FRAMES), Shots.FOUR).dcs_lsb
    assert torch.allclose(raw[:, 0], -raw[:, 2]) and torch.allclose(raw[:, 1], -raw[:, 3])
    with np.load(folder / "file0.npz") as file:
        planes = file["dcs"].astype(np.float64)
    cosine = (2 * planes[:, 0] - planes[:, 1] - planes[:, 2]) / 3
    assert np.allclose(raw[:, 0].numpy(), cosine, atol=1e-2)


def test_the_flags_of_two_samples_are_theirs_alone(take_in, tmp_path):
    folder = write_plain(tmp_path / "in", count=1)
    with np.load(folder / "file0.npz") as file:
        arrays = dict(file)
    # The ends of the range report overflow; stored as 0, 180, 90, 270 degrees.
    arrays["dcs"][0, 6, 2, 3], arrays["dcs"][1, 2, 1, 1] = 2047, -2048
    camera = folder / "camera" / "bench.yaml"
    camera.write_text(camera.read_text().replace("[0, 90, 180, 270]", "[0, 180, 90, 270]"))
    np.savez(folder / "file0.npz", **arrays)
    bank = take_in(folder, tmp_path / "out")
    flags = {shots: bank.words(torch.arange(FRAMES), shots).saturated for shots in Shots}
    assert not flags[Shots.FOUR][0].any() and flags[Shots.EIGHT][0].nonzero().tolist() == [[2, 3]]
    assert flags[Shots.TWO][1].nonzero().tolist() == [[1, 1]]


def test_a_drive_plays_the_recording_of_its_seed(take_in, tmp_path):
    rows = [{"file": "file0.npz", "seed": 9}, {"file": "file1.npz", "family": "street"}]
    bank = take_in(write_plain(tmp_path / "in", recordings=rows), tmp_path / "out")
    generator = torch.Generator().manual_seed(0)
    for seed, start in ((9, 0), (1, FRAMES)):
        frames, _ = chain_recorded(
            bank.clips, FRAMES, bank.settings, seed=seed, generator=generator
        )
        assert frames.tolist() == list(range(start, start + FRAMES))
    assert [clip.family for clip in bank.clips] == ["recorded", "street"]
