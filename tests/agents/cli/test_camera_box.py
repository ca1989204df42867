"""Every shipped camera, from what comes out of its box to a report."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from agents.cli.entry import main

ROOT = Path(__file__).parents[3]
CAMERAS = (
    "epc660_hdf5",
    "epc660_wire",
    "mlx75027",
    "mlx75027_reversed",
    "imx556",
    "arducam_b0548",
    "kinect_v2_dump",
    "phasor_video",
)
"""All but the Kinect's logs, whose images are of one size, and the one for simulation."""
TELL_NO_NOISE = ("kinect_v2_dump", "phasor_video")
DRIVES, FRAMES, SIZE = 2, 9, (24, 32)


@pytest.fixture(scope="session")
def made_up_camera():
    """The example's module; it imports the one beside it."""
    sys.path.insert(0, str(ROOT / "examples"))
    try:
        import made_up_camera
    finally:
        sys.path.remove(str(ROOT / "examples"))
    return made_up_camera


@pytest.fixture
def run(capsys):
    """A command; what it says on stdout, or on stderr where it is to fail."""

    def run(*words, status=0):
        found = main([str(word) for word in words])
        out, err = capsys.readouterr()
        assert found == status, err
        return err if status else out

    return run


def only(folder, pattern):
    (found,) = folder.glob(pattern)
    return found


@pytest.mark.parametrize("name", CAMERAS)
def test_from_the_box_to_a_report(made_up_camera, run, tmp_path, name):
    box, camera = tmp_path / "box", tmp_path / "box" / "camera.yaml"
    made_up_camera.main(box, name, 1, drives=DRIVES, frames=FRAMES, size=SIZE)
    wall = next(path for path in box.glob("wall.*"))
    told = tmp_path / "told.json"
    run("camera", "describe", wall, "--camera", camera, "--known-distance", 1.5, "--json", told)
    found = json.loads(told.read_text())
    assert found["frames"] == 8 and found["odd"] == []
    assert any(way["described"] and way["fits"] for way in found["labellings"])

    drive = next(path for path in box.glob("drives/drive_0.*"))
    noise = ("--noise-lsb", 2.0) if name in TELL_NO_NOISE else ()
    words = ("--camera", camera, "--unwrapper", "none", "--out", tmp_path / "depth", *noise)
    run("unwrap", "correct", drive, *words)
    sensor = tmp_path / "calibrated.yaml"
    words = (box / "bench", "--camera", camera, "--out", sensor)
    if name in TELL_NO_NOISE:
        # Phasors tell neither offsets nor noise: the sensor stays that of the data sheet.
        assert "expected four samples a frequency" in run("camera", "calibrate", *words, status=1)
        sensor = box / "sensor.yaml"
    else:
        assert "full_well_e" in run("camera", "calibrate", *words)
        assert sensor.with_suffix(".html").is_file()

    truth_m = np.load(box / "drives" / "drive_0_truth.npy")
    for frame in range(FRAMES):
        depth = np.load(tmp_path / "depth" / f"{frame:05d}" / "depth_m.npy")
        assert depth.shape == truth_m[frame].shape
