"""`shotenv camera calibrate --camera`: recordings as cameras write them."""

from __future__ import annotations

import json
from dataclasses import replace

import camera_files
import h5py
import numpy as np
import pytest
from calibration_bench import example

from agents.cli import main
from agents.cli.cameras.camera_calibrate_command import as_described
from agents.cli.cameras.camera_commands import read_camera
from shotenv.config import SensorConfig, find_config, merged, read_config
from unwrap.signal import read_wiggle

SEED, TRAILER = 5, bytes(396)
DELIVERED = {
    "epc660_hdf5": {"f1_hz": 24e6, "f2_hz": 10e6},
    "epc660_wire": {"f1_hz": 24e6, "f2_hz": 10e6},
    "mlx75027": {"f1_hz": 60e6, "f2_hz": 10e6},
    "imx556": {"f1_hz": 100e6, "f2_hz": 20e6},
    "arducam_b0548": {"f1_hz": 90e6, "f2_hz": 15e6},
}
"""Frequencies of each; that of four samples is the first."""
SMALL = {
    "imx556": {
        "layout": {"height": 24, "width": 32, "row_bytes": 48},
        "lens": {"horizontal_fov_deg": example.FOV_DEG},
    },
    "arducam_b0548": {
        "layout": {"height": 24, "width": 32, "row_bytes": 50, "trailer_rows": 0},
    },
}
"""Changes of the descriptions; fields of view of the others are that of the bench as shipped."""
FULL = {"epc660_hdf5": 64003, "epc660_wire": 64003 - 2048, "mlx75027": 2047, "imx556": 2047}
"""What stands in place of the samples of a full pixel; the B0548's range ends at 1023."""


def imager(name):
    """A camera whose hidden numbers are to be found, with the frequencies and bits of its kind."""
    camera = example.hidden_camera(SEED)
    changed = DELIVERED[name] | {"max_range_m": 7.0, "saturation_range_m": 1.0}
    if name == "arducam_b0548":
        changed |= {"adc_bits": 11, "gain_lsb_per_e": camera.sensor.gain_lsb_per_e / 2}
    return replace(camera, sensor=merged(camera.sensor, changed))


def write(name, path, samples, gray, known):
    """Samples D0..D3 [F, K, 4, H, W] and gray words as the camera stores them; what its row says.

    The order of the planes is that of `camera_files.ordered`.
    """
    first, told = samples[:, 0], dict(known)
    d0, d1, d2, d3 = np.moveaxis(samples, 2, 0)
    if name == "epc660_hdf5":
        path = path.with_suffix(".h5")
        camera_files.write_espros(path, first)
        camera_files.write_espros(path.with_suffix(".gray.h5"), gray, image_type="Grayscale")
        told["gray"] = path.with_suffix(".gray.h5").name
    elif name == "epc660_wire":
        path = path.with_suffix(".bin")
        celsius = [told.pop("temperature_k") - 273.15] * len(first)
        camera_files.write_wire(path, first, gray=gray, celsius=celsius)
    elif name == "mlx75027":
        path = path.with_suffix(".npz")
        planes = np.stack((d0, d2, d1, d3), 2)[:, 0].astype(np.int16)
        beside = {n: np.float64(told.pop(n)) for n in ("temperature_k", "integration_s")}
        np.savez(path, dcs=planes, gray=gray, **beside)
    else:
        path = path.with_suffix(".raw")
        gray_path = path.with_suffix(".npy")
        np.save(gray_path, gray)
        told["gray"] = gray_path.name
        if name == "imx556":
            camera_files.write_raw12(path, samples, trailer=TRAILER)
        else:
            planes = np.stack((d2, d1, d0, d3), 2)
            camera_files.write_raw12(path, planes, row_bytes=50, twelfth=1)
    return {"file": path.name, **told}


def made_up(name, folder, *, drop=lambda row: False):
    """A bench of the camera in `folder`; the camera, and the name of its description."""
    folder.mkdir()
    camera, rows = imager(name), []
    half = 2 ** (camera.sensor.adc_bits - 1)
    for number, (known, scene, frames) in enumerate(example.bench(camera)):
        if drop(known):
            continue
        raw, gray, exposure_s = example.record(camera, scene, frames, number)
        words = np.rint(raw.dcs_lsb.numpy()).clip(-half, half - 1).astype(np.int32)
        words = np.where(raw.saturated.numpy()[:, None], FULL.get(name, half - 1), words)
        samples = words.reshape(frames, 2, 4, camera.height, camera.width)
        path = folder / f"{number:02d}_{known['kind']}"
        # The gray image is of the camera's own bits; that of these files is of 12.
        gray = gray.numpy().astype(np.uint16)
        rows.append(write(name, path, samples, gray, known | {"gray_exposure_s": exposure_s}))
    (folder / "calibration.yaml").write_text(json.dumps({"name": "mine", "recordings": rows}))
    return camera, str(camera_files.small_camera(folder, name, **SMALL.get(name, {})))


def calibrate(folder, described, *words):
    out = str(folder / "sensor.yaml")
    return main(["camera", "calibrate", str(folder), "--camera", described, "--out", out, *words])


@pytest.mark.parametrize("name", DELIVERED)
def test_hidden_numbers_are_found_in_a_cameras_own_files(name, tmp_path, capsys):
    folder = tmp_path / "bench"
    camera, described = made_up(name, folder)
    assert calibrate(folder, described, "--json", str(folder / "numbers.json")) == 0
    told = capsys.readouterr().out
    numbers = json.loads((folder / "numbers.json").read_text())["numbers"]
    hidden = camera.sensor.model_dump() | {"distance_offset_m": camera.delay_m}
    assert {"gain_lsb_per_e", "full_well_e", "harmonic_strength", "distance_offset_m"} <= {*numbers}
    for number, found in numbers.items():
        if number in hidden:
            # Twice as wide again as the interval of 95 %: one in 1e8 lies outside.
            width = found["high"] - found["low"]
            assert found["low"] - width < hidden[number] < found["high"] + width, number
    sensor = read_config(SensorConfig, folder / "sensor.yaml")
    assert sensor.f1_hz == DELIVERED[name]["f1_hz"] and sensor.adc_bits == camera.sensor.adc_bits
    tables = read_wiggle(folder / "sensor.wiggle.json")
    two = name in ("imx556", "arducam_b0548")
    assert list(tables) == list(DELIVERED[name].values())[: 1 + two]
    assert ("f2_hz" in told) == two
    page = (folder / "sensor.html").read_text(encoding="utf-8")
    assert "<td>298.15</td>" in page and "<td>0.6</td>" in page
    if name == "imx556":
        assert (
            "f1_hz                   100.0e+6  # [described] of imx556; epc660 has 2.4e+07" in told
        )
        assert "says f1_hz 100.0e+6, f2_hz 20.0e+6, saturation" in page
        assert sensor.f2_hz == 20e6 and sensor.max_range_m == 7.4948


def test_what_was_written_corrects_the_cameras_recordings(tmp_path):
    """Delay and overtones of a wall are gone with the measured table."""
    folder = tmp_path / "bench"
    camera, described = made_up("imx556", folder)
    assert calibrate(folder, described) == 0
    wall, at_m = "15_wall.raw", None
    for row in json.loads((folder / "calibration.yaml").read_text())["recordings"]:
        at_m = row["distance_m"] if row["file"] == wall else at_m
    words = ["--camera", described, "--unwrapper", "none", "--out", str(folder / "depth")]
    stored = ["--wiggle", str(folder / "sensor.wiggle.json")]
    stored += ["--offset", str(folder / "sensor.offset.npy")]
    assert main(["unwrap", "correct", str(folder / wall), *words, *stored]) == 0
    depth = np.load(folder / "depth" / "00000" / "depth_m.npy")
    off_m = np.median(depth / (at_m * camera.stretch.numpy())) * at_m - at_m
    # The table holds; without it the delay of decimetres would stand.
    assert abs(off_m) < 0.005 < abs(camera.delay_m)


def not_dark(row):
    return row["kind"] != "dark"


@pytest.mark.parametrize(
    ("name", "camera", "sentence"),
    [
        ("mlx75027", "blaze", "blaze is described for simulation"),
        ("mlx75027", "phasor_video", "00_dark.npz: 32 planes; expected 2 of phasor_video"),
        ("imx556", "arducam_b0548", "00_dark.raw: frame 0 has"),
        ("epc660_hdf5", "epc660_wire", "00_dark.h5"),
    ],
)
def test_another_cameras_description_is_refused(name, camera, sentence, tmp_path, capsys):
    made_up(name, tmp_path / "bench", drop=not_dark)
    assert calibrate(tmp_path / "bench", camera) == 1
    assert sentence in capsys.readouterr().err
    assert not (tmp_path / "bench" / "sensor.yaml").exists()


def rewritten(folder, **top):
    path = folder / "calibration.yaml"
    path.write_text(json.dumps(json.loads(path.read_text()) | top))


def test_ranges_follow_the_frequencies():
    epc660 = read_config(SensorConfig, find_config("sensor", "epc660"))
    camera, _ = read_camera("epc660_hdf5")
    assert as_described(epc660, camera, (24e6,)) == (epc660, {})
    slow, lines = as_described(epc660, camera, (12e6,))
    assert slow == merged(epc660, {"f1_hz": 12e6, "saturation_range_m": 12.4})
    assert lines == {
        "f1_hz": "12.0e+6  # [described] of epc660 (HDF5); epc660 has 2.4e+07",
        "saturation_range_m": "12.4  # [described] by the frequencies of epc660 (HDF5); epc660 has "
        "6.2",
    }
    fast, _ = as_described(epc660, camera, (100e6, 20e6))
    assert (fast.saturation_range_m, fast.max_range_m) == (1.488, 7.4948)


def test_phasors_tell_neither_offsets_nor_noise(tmp_path, capsys):
    np.save(tmp_path / "a.npy", np.ones((3, 24, 32, 2), np.float32))
    rows = [{"file": "a.npy", "kind": "dark"}]
    (tmp_path / "calibration.yaml").write_text(json.dumps({"recordings": rows}))
    assert calibrate(tmp_path, "phasor_video") == 1
    assert "a.npy: phasors, or three phases, of phasor_video" in capsys.readouterr().err


def test_directions_are_told_once(tmp_path, capsys):
    _, described = made_up("mlx75027", tmp_path / "bench", drop=not_dark)
    rewritten(tmp_path / "bench", horizontal_fov_deg=60)
    assert calibrate(tmp_path / "bench", described) == 1
    assert "horizontal_fov_deg is 60, and the lens of mlx75027 tells" in capsys.readouterr().err


def test_recordings_are_of_one_frequency_and_one_temperature(tmp_path, capsys):
    folder = tmp_path / "bench"
    _, described = made_up("mlx75027", folder, drop=not_dark)
    path = folder / "02_dark.npz"
    stored = dict(np.load(path))
    np.savez(path, **stored | {"frequencies_hz": np.array([80e6])})
    assert calibrate(folder, described) == 1
    said = capsys.readouterr().err
    assert "02_dark.npz: recorded at 80 MHz; expected 60, as 00_dark.npz" in said
    warming = np.linspace(298.0, 305.0, len(stored["dcs"]))
    np.savez(path, **stored | {"temperature_k": warming})
    assert calibrate(folder, described) == 1
    assert (
        "02_dark.npz: temperature_k goes from 298 to 305; expected one" in capsys.readouterr().err
    )
    # What calibration.yaml tells counts.
    rows = json.loads((folder / "calibration.yaml").read_text())["recordings"]
    told = [row | ({"temperature_k": 301.0} if row["file"] == path.name else {}) for row in rows]
    rewritten(folder, recordings=told)
    assert calibrate(folder, described) == 0


def test_a_sensor_that_cannot_have_the_frequencies_is_named(tmp_path, capsys):
    folder = tmp_path / "bench"
    made_up("epc660_hdf5", folder, drop=not_dark)
    slow = camera_files.small_camera(folder, "epc660_hdf5", frequencies_hz=[6e6])
    for path in folder.glob("*_dark.h5"):
        with h5py.File(path, "r+") as file:
            file.attrs["mod_frequency"] = 6.0
    assert calibrate(folder, str(slow)) == 2
    assert "expected a --sensor whose f2_hz is less" in capsys.readouterr().err
