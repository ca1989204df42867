"""Simulated drives as a camera would have recorded them."""

import numpy as np
import pytest
import torch
import yaml
from camera_files import small_camera

from shotenv.config.keywords import env_config
from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import SensorConfig
from shotenv.decision.acquire import acquire_depths
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import drive_of_seed
from shotenv.recorded import deliver_drive, write_drives
from unwrap.cameras import open_camera_recording
from unwrap.cameras.files import CameraDescription
from unwrap.signal.shots import Shots
from unwrap.support.tensors import take

SEED = 5


@pytest.fixture(scope="module")
def problem(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        config = env_config(**{**tiny_kwargs, "frames_per_drive": 20}, split="test")
        # Long enough that pixels fill in the sun.
        yield open_problem(merged(config, {"sensor": {"integration_s": (2e-3, 3e-3)}}))


def described(path):
    return read_config(CameraDescription, find_config("camera", str(path)))


@pytest.fixture
def camera(tmp_path):
    """Arrays of samples at both frequencies of the sensor."""
    return described(small_camera(tmp_path, "mlx75027", frequencies_hz=[24e6, 10e6]))


def acquired(problem, seed):
    """Every acquisition of every frame, as an environment takes them."""
    drive = drive_of_seed(problem, seed)
    steps = torch.arange(drive.frames.shape[1])
    return acquire_depths(problem, take(drive, torch.zeros_like(steps)), steps, tuple(Shots))


def test_samples_and_flags_are_those_of_the_environment(problem):
    delivered = deliver_drive(problem, SEED)
    samples = delivered.frames.samples_lsb.flatten(1, 2)
    flags = delivered.frames.saturated_samples.flatten(1, 2)
    for one in acquired(problem, SEED):
        assert torch.equal(samples[:, : one.raw.shots], one.raw.dcs_lsb)
        assert torch.equal(flags[:, : one.raw.shots].any(1), one.raw.saturated)
    # Some pixels are full in later samples only, and some without an extreme word.
    assert (flags[:, 2:].any(1) & ~flags[:, :2].any(1)).any()
    assert (flags & (samples.abs() < 2000)).any()
    assert torch.equal(delivered.frames.saturated, flags.any(1))


def test_truth_is_where_the_environment_scores(problem):
    delivered, (one, *_) = deliver_drive(problem, SEED), acquired(problem, SEED)
    assert torch.equal(~delivered.truth_m.isnan(), one.scored)
    assert torch.equal(delivered.truth_m[one.scored], one.truth_m[one.scored])
    assert 0 < one.scored.float().mean() < 1


def test_a_folder_holds_what_the_drives_delivered(problem, camera, tmp_path):
    folder, ticks = tmp_path / "drives", []
    write_drives(folder, problem, {"a": SEED, "b": SEED + 1}, camera, tick=ticks.append)
    assert sum(ticks) == 2 * 21
    about = yaml.safe_load((folder / "recordings.yaml").read_text())
    assert about["name"] == "drives" and about["frame_rate_hz"] == 10.0
    assert read_config(SensorConfig, folder / "sensor.yaml") == problem.config.sensor
    assert {path.name for path in folder.iterdir()} == {
        "recordings.yaml",
        "sensor.yaml",
        *(row[kind] for row in about["recordings"] for kind in ("file", "truth", "offset", "ego")),
    }
    for seed, row in zip((SEED, SEED + 1), about["recordings"], strict=True):
        delivered, drive = deliver_drive(problem, seed), drive_of_seed(problem, seed)
        # An archive tells its settings itself.
        assert row["seed"] == seed and "gray" not in row and "laser_power_w" not in row
        assert row["ambient_k"] == float(drive.ambient_k)
        assert row["shift_m"] == float(drive.drift_m) != 0.0
        found = open_camera_recording(folder / row["file"], camera).read(0, 21)
        for name in ("samples_lsb", "saturated_samples", "gray"):
            assert torch.equal(getattr(found, name), getattr(delivered.frames, name)), name
        assert found.laser_power_w == (float(drive.laser_power_w),) * 21
        assert found.integration_s == (float(drive.integration_s),) * 21
        rise_k = problem.config.sensor.self_heating_k
        assert found.temperature_k == (float(drive.ambient_k) + rise_k,) * 21
        np.testing.assert_array_equal(np.load(folder / row["truth"]), delivered.truth_m)
        np.testing.assert_array_equal(
            np.load(folder / row["offset"]), drive.offsets.calibrated_lsb[0]
        )
        table = np.genfromtxt(folder / row["ego"], delimiter=",", names=True)
        rows = drive.frames[0].numpy()
        for name in ("ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s"):
            np.testing.assert_array_equal(table[name], getattr(problem.bank, name)[rows])


def test_what_the_files_lack_is_told_beside_them(problem, tmp_path):
    write_drives(tmp_path / "drives", problem, {"a": SEED}, described("epc660_hdf5"))
    (row,) = yaml.safe_load((tmp_path / "drives" / "recordings.yaml").read_text())["recordings"]
    drive = drive_of_seed(problem, SEED)
    assert row["file"] == "a.h5" and row["gray"] == "a_gray.h5"
    assert row["laser_power_w"] == float(drive.laser_power_w)
    assert row["integration_s"] == float(drive.integration_s)
    assert row["temperature_k"] == float(drive.ambient_k) + problem.config.sensor.self_heating_k
    recording = open_camera_recording(
        tmp_path / "drives" / row["file"],
        described("epc660_hdf5"),
        gray=tmp_path / "drives" / row["gray"],
    )
    found, delivered = recording.read(0, 21), deliver_drive(problem, SEED).frames
    # One frequency, and codes in the place of full samples.
    assert found.frequencies_hz == (24e6,)
    flags = delivered.saturated_samples[:, :1]
    assert torch.equal(found.saturated_samples, flags) and flags.any()
    assert torch.equal(found.samples_lsb[~flags], delivered.samples_lsb[:, :1][~flags])
    assert torch.equal(found.gray, delivered.gray)


def test_all_or_nothing_and_nothing_over(problem, camera, tmp_path, monkeypatch):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "mine.txt").write_text("mine")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ValueError, match="full is not an empty folder; nothing is written over"):
        write_drives(tmp_path / "full", problem, {"a": SEED}, camera)
    # Half way through the second drive.
    seen = []

    def interrupted(frames):
        seen.append(frames)
        if sum(seen) > 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_drives(
            tmp_path / "drives", problem, {"a": SEED, "b": SEED + 1}, camera, tick=interrupted
        )
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "full" / "mine.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("name", "changes", "error"),
    [
        ("blaze", {}, "blaze is described for simulation; it has no recordings"),
        ("imx556", {}, "frequencies are 24 and 10 MHz; expected 100 and 20 MHz, as imx556 has"),
        ("kinect_v2", {}, "frequencies are 24 and 10 MHz; expected 80 and 16 and 120 MHz"),
        (
            "epc660_wire",
            {"frequencies_hz": [10e6]},
            r"epc660 \(wire\) takes 10 MHz alone; expected 24 MHz, at which 2 and 4 samples",
        ),
        (
            "mlx75027",
            {"words": {"bits": 11}},
            "words of mlx75027 have 11 bits; expected at least 12, as sensor epc660 has",
        ),
        (
            "epc660_hdf5",
            {"constants": {"laser_power_w": 2.5}},
            r"constants.laser_power_w of epc660 \(HDF5\) is 2.5; expected none, as each drive",
        ),
    ],
)
def test_a_camera_that_cannot_hold_the_drives_is_refused(problem, tmp_path, name, changes, error):
    camera = described(small_camera(tmp_path, name, **changes))
    with pytest.raises(ValueError, match=error):
        write_drives(tmp_path / "drives", problem, {"a": SEED}, camera)
    assert not (tmp_path / "drives").exists()
