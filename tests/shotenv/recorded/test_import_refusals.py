"""What `bank import` refuses, by name, and that it then writes nothing."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
import yaml

from agents.cli.cameras.camera_commands import read_camera
from shotenv.config.reader import find_config
from shotenv.recorded.bank_import import import_bank

SINGLE = "drive_0.npz"


def rewritten(folder, **changes):
    """The first recording with arrays changed, or left out where None."""
    path = folder / SINGLE
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    for name, change in changes.items():
        if change is None:
            del arrays[name]
        else:
            arrays[name] = change(arrays.get(name))
    np.savez(path, **arrays)


def told(folder, change):
    """`recordings.yaml` with its first recording changed."""
    path = folder / "recordings.yaml"
    content = yaml.safe_load(path.read_text())
    change(content["recordings"][0])
    path.write_text(yaml.safe_dump(content))


def without(name):
    return lambda folder: told(folder, lambda row: row.pop(name))


def gap(times):
    return times + 0.2 * (np.arange(len(times)) > 6)


def warming(frames):
    return lambda _: 300.0 + np.linspace(0, 8, frames)


def cropped(folder):
    keep = slice(0, 20)
    rewritten(
        folder,
        dcs=lambda a: a[..., keep, :],
        gray=lambda a: a[..., keep, :],
        saturated=lambda a: a[..., keep, :],
    )
    for name in ("truth", "offset"):
        path = folder / f"drive_0_{name}.npy"
        np.save(path, np.load(path)[..., keep, :])


CASES = {
    "dropped": (
        lambda f: rewritten(f, timestamp_s=gap),
        r"drive_0.npz: frame 00007 comes 0.3 s after frame 00006.*about 2 frames were dropped",
    ),
    "backwards": (
        lambda f: rewritten(f, timestamp_s=lambda t: t[::-1]),
        "drive_0.npz: frame 00001 is 0.1 s earlier than frame 00000",
    ),
    "no gray": (lambda f: rewritten(f, gray=None), "drive_0.npz: no gray images"),
    "NaN": (
        lambda f: rewritten(f, dcs=lambda a: np.where(a == a.max(), np.nan, a)),
        "drive_0.npz: frame .* holds nan",
    ),
    "range": (
        lambda f: rewritten(f, dcs=lambda a: a * 40),
        "drive_0.npz: frame .* expected words of -2048..2047",
    ),
    "flags": (
        lambda f: rewritten(f, saturated=lambda a: a[:, 0, 0]),
        r"drive_0.npz: saturated is bool \(13, 32\); expected bool, as dcs or \(13, 24, 32\)",
    ),
    "laser": (
        without("laser_power_w"),
        "drive_0.npz: no laser_power_w is stored; expected it in r",
    ),
    "ambient": (
        without("ambient_k"),
        "drive_0.npz: no temperature_k is stored; expected it in rec",
    ),
    "exposure": (without("ego"), "drive_0.npz: no gray_exposure_s is told; expected it in recordi"),
    "two values": (
        lambda f: rewritten(f, integration_s=lambda _: np.array(0.9e-3)),
        "drive_0.npz: integration_s is 0.0009 as stored, and .* in recordings.yaml",
    ),
    "long": (
        lambda f: told(f, lambda row: row.update(integration_s=0.02)),
        "drive_0.npz: integration_s is 0.02; expected less than sample_period_s = 0.00385",
    ),
    "changing": (
        lambda f: rewritten(f, laser_power_w=lambda _: 5.0 + (np.arange(13) > 4)),
        "laser_power_w changes from 5 in frame 00000 to 6 in frame 00005",
    ),
    "warming": (
        lambda f: rewritten(f, temperature_k=warming(13)),
        "temperature_k changes from 300 in frame 00000 to 308 in frame 00012",
    ),
    "sizes": (cropped, r"drive_1.npz: frames are \(24, 32\); expected \(20, 32\), as the others"),
    "truth": (
        lambda f: np.save(f / "drive_0_truth.npy", np.ones((12, 24, 32), np.float32)),
        r"drive_0_truth.npy: truth is float32 \(12, 24, 32\); expected floats \(13, 24, 32\)",
    ),
    "negative": (
        lambda f: np.save(f / "drive_0_truth.npy", np.full((13, 24, 32), -1.0)),
        "drive_0_truth.npy: frame 0 holds -1 m at row 0, column 0; expected positive distances",
    ),
    "offset": (
        lambda f: np.save(f / "drive_0_offset.npy", np.full((24, 32), np.inf)),
        "drive_0_offset.npy: offset is float64",
    ),
    "rows": (
        lambda f: (f / "drive_0_ego.csv").write_text("ego_speed_m_s\n1.0\n"),
        "drive_0_ego.csv: 1 rows; expected 13",
    ),
    "column": (
        lambda f: (f / "drive_0_ego.csv").write_text("speed\n" + "1\n" * 13),
        "drive_0_ego.csv: column 'speed'; expected some of",
    ),
    "number": (
        lambda f: (f / "drive_0_ego.csv").write_text("gray_exposure_s\n" + "0.001\n" * 12 + "0\n"),
        "drive_0_ego.csv: gray_exposure_s of frame 12 is '0'; expected a positive number",
    ),
    "missing": (lambda f: (f / SINGLE).unlink(), "drive_0.npz"),
    "cut off": (
        lambda f: (f / SINGLE).write_bytes((f / SINGLE).read_bytes()[:-100]),
        "drive_0.npz",
    ),
    "key": (
        lambda f: told(f, lambda row: row.update(depth="x")),
        "recordings.yaml: .*Option 'depth' is not accepted",
    ),
    "rate": (
        lambda f: rewritten(f, timestamp_s=lambda t: 2 * t),
        "drive_1.npz: frames come at 10 Hz; expected 5 Hz, as the others",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_with_a_recording_is_said_and_nothing_is_written(
    case, folder, take_in, tmp_path
):
    spoil, message = CASES[case]
    shutil.copytree(folder, tmp_path / "in")
    spoil(tmp_path / "in")
    with pytest.raises(ValueError, match=message):
        take_in(tmp_path / "in", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["in"]


def test_nothing_is_written_over(folder, take_in, tmp_path):
    (tmp_path / "note.txt").write_text("mine")
    with pytest.raises(ValueError, match="is not empty; choose another folder"):
        take_in(folder, tmp_path)
    assert (tmp_path / "note.txt").read_text() == "mine"


def test_an_import_that_has_ended_already_leaves_what_stands(folder, take_in, tmp_path):
    out = tmp_path / "bank"
    first = take_in(folder, out)
    (out / "env.yaml").write_text("changed")
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    assert take_in(folder, out).fingerprint == first.fingerprint
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    assert list(tmp_path.iterdir()) == [out]


def test_an_import_of_other_recordings_is_refused(folder, take_in, tmp_path, monkeypatch):
    out = tmp_path / "bank"
    take_in(folder, out)
    shutil.copytree(folder, tmp_path / "in")
    truth = np.load(tmp_path / "in" / "drive_0_truth.npy")
    np.save(tmp_path / "in" / "drive_0_truth.npy", truth + np.float32(0.25))
    with pytest.raises(ValueError, match="bank holds another bank; choose another folder, or"):
        take_in(tmp_path / "in", out)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bank", "in"]
    # What can be told without the work is told before it.
    monkeypatch.setattr("shotenv.recorded.bank_import.take_in", None)
    with pytest.raises(ValueError, match="holds another bank"):
        take_in(folder, out, truth="own")


def test_a_sensor_of_other_frequencies_is_refused(folder, take_in, tmp_path):
    with pytest.raises(ValueError, match="are 24 and 10 MHz, and those of sensor mlx75027 60 and"):
        take_in(folder, tmp_path / "out", sensor="mlx75027")


def test_a_truth_that_cannot_be_had_is_refused(folder, take_in, tmp_path):
    shutil.copytree(folder, tmp_path / "in")
    without("truth")(tmp_path / "in")
    for wanted in ("external", None):
        with pytest.raises(ValueError, match=r"'external', but recordings.yaml names none of dri"):
            take_in(tmp_path / "in", tmp_path / "out", truth=wanted)
    assert take_in(tmp_path / "in", tmp_path / "out", truth="own").truth_level == "own"


def test_a_folder_without_recordings_says_what_was_tried(folder, take_in, tmp_path):
    (tmp_path / "in" / "camera").mkdir(parents=True)
    camera = tmp_path / "in" / "camera" / "bench.yaml"
    shutil.copy(folder / "camera" / "bench.yaml", camera)
    (tmp_path / "in" / "notes.txt").write_text("none")
    with pytest.raises(ValueError, match=r"in holds no recording of bench \(.*(notes\.txt|camera)"):
        take_in(tmp_path / "in", tmp_path / "out")


def test_a_folder_that_is_none_is_named(folder, tmp_path):
    camera, _ = read_camera(str(folder / "camera" / "bench.yaml"))
    with pytest.raises(ValueError, match="nowhere is no folder; expected one that holds record"):
        import_bank(tmp_path / "nowhere", camera, find_config("sensor", "epc660"), tmp_path / "out")
