"""`shotenv camera calibrate`: from a folder of recordings to a sensor that simulates the camera."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import pytest
from calibration_bench import example

from agents.cli import main
from shotenv.config import SensorConfig, read_config
from unwrap.signal import read_wiggle

SEED = 5


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bench")
    example.main(folder, SEED)
    return folder


def kept(bench, folder, *, drop=lambda row: False, **top):
    """The bench without some of its recordings, with other entries beside them."""
    shutil.copytree(bench, folder, ignore=shutil.ignore_patterns("sensor*"))
    told = re.search(r"\[\n(.*)\n\]", (bench / "calibration.yaml").read_text(), re.DOTALL)[1]
    rows = [row for row in json.loads(f"[{told}]") if not drop(row)]
    whole = {"name": "mine", "horizontal_fov_deg": 60.0, "recordings": rows} | top
    (folder / "calibration.yaml").write_text(json.dumps(whole))
    return folder


def calibrate(folder, *words):
    return main(["camera", "calibrate", str(folder), "--out", str(folder / "sensor.yaml"), *words])


def test_a_folder_becomes_a_sensor_with_its_tables_map_and_page(bench, capsys):
    assert calibrate(bench, "--json", str(bench / "numbers.json")) == 0
    hidden = json.loads((bench / "hidden.yaml").read_text())
    sensor = read_config(SensorConfig, bench / "sensor.yaml")
    numbers = json.loads((bench / "numbers.json").read_text())
    assert numbers["missing"] == numbers["refused"] == {}
    assert sensor.name == f"made-up-{SEED}" and sensor.calibration_temperature_k == example.ROOM_K
    text = (bench / "sensor.yaml").read_text()
    for name, number in numbers["numbers"].items():
        if name in hidden and name != "distance_offset_m":
            assert getattr(sensor, name) == pytest.approx(hidden[name], rel=0.5), name
            assert re.search(rf"^{name}: \S+  # .*\[measured\] \S+ to \S+$", text, re.MULTILINE)
            assert getattr(sensor, name) == pytest.approx(number["value"], rel=1e-2)
    assert "f_number: 1.2                 # [assumed]" in text
    tables = read_wiggle(bench / "sensor.wiggle.json")
    assert list(tables) == [24e6, 10e6]
    metres = np.mean(tables[24e6].error_rad) * 299_792_458.0 / (4 * np.pi * 24e6)
    assert metres == pytest.approx(hidden["distance_offset_m"], abs=1e-3)
    offset = np.load(bench / "sensor.offset.npy")
    assert offset.dtype == np.float32 and offset.shape == (24, 32)
    page = (bench / "sensor.html").read_text(encoding="utf-8")
    for title in ("Photon transfer", "Ambient light", "Full well", "Dark-offset map", "Wiggle"):
        assert f"<h2>{title}</h2>" in page
    assert "13 of 13 numbers measured" in page and "What to record" not in page
    assert "not measured" not in capsys.readouterr().out
    # What was written serves the command that corrects recordings.
    words = ["--sensor", str(bench / "sensor.yaml"), "--wiggle", str(bench / "sensor.wiggle.json")]
    corrected = ["--offset", str(bench / "sensor.offset.npy"), "--out", str(bench / "depth")]
    wall = next(bench.glob("*_wall.npz"))
    assert main(["unwrap", "correct", str(wall), *words, *corrected]) == 0


def test_what_recordings_cannot_tell_keeps_its_value_and_is_asked_for(bench, tmp_path, capsys):
    """Dark frames alone: no gain, and so a read noise that leans on that of the kind."""
    folder = kept(bench, tmp_path / "dark", drop=lambda r: r["kind"] != "dark" or "ambient" in r)
    assert calibrate(folder) == 0
    said = capsys.readouterr().out
    assert re.search(r"read_noise_e .* given gain_lsb_per_e", said)
    assert re.search(r"full_well_e +not measured e  record a still scene so bright", said)
    text = (folder / "sensor.yaml").read_text()
    assert "full_well_e: 160.0e+3         # [mlx] per tap" in text
    assert re.search(r"^read_noise_e: .*, given gain_lsb_per_e$", text, re.MULTILINE)
    assert "harmonic_strength: 0.3 " in text and "distance_drift_m_per_k: 12.5e-3" in text
    assert not (folder / "sensor.wiggle.json").exists()
    page = (folder / "sensor.html").read_text(encoding="utf-8")
    assert "What to record for the others" in page and "<h2>Wiggle</h2>" not in page


def test_without_ambient_light_the_gain_leans_on_the_contrast(bench, tmp_path):
    folder = kept(bench, tmp_path / "still", drop=lambda r: "ambient" in r)
    assert calibrate(folder) == 0
    hidden = json.loads((bench / "hidden.yaml").read_text())
    sensor = read_config(SensorConfig, folder / "sensor.yaml")
    text = (folder / "sensor.yaml").read_text()
    assert re.search(r"^gain_lsb_per_e: .*, given contrast$", text, re.MULTILINE)
    told = sensor.gain_lsb_per_e / sensor.contrast
    assert told == pytest.approx(hidden["gain_lsb_per_e"] / hidden["contrast"], rel=0.03)


def test_four_samples_without_gray_serve(bench, tmp_path):
    folder = kept(bench, tmp_path / "four", drop=lambda r: "ambient" in r)
    for path in folder.glob("*.npz"):
        with np.load(path) as arrays:
            np.savez(path, dcs=arrays["dcs"][:, :4], saturated=arrays["saturated"])
    assert calibrate(folder) == 0
    assert list(read_wiggle(folder / "sensor.wiggle.json")) == [24e6]
    page = (folder / "sensor.html").read_text(encoding="utf-8")
    assert "Wiggle tables at 24 MHz take" in page


def test_a_drift_that_the_simulation_cannot_hold_is_not_written(bench, tmp_path, capsys):
    """Temperatures told the wrong way round: distances would shrink with heat."""
    folder = kept(bench, tmp_path / "cold")
    whole = json.loads((folder / "calibration.yaml").read_text())
    for row in whole["recordings"]:
        if row["kind"] == "warm":
            row["temperature_k"] = 620.0 - row["temperature_k"]
    (folder / "calibration.yaml").write_text(json.dumps(whole))
    assert calibrate(folder) == 0
    assert "not written: distance_drift_m_per_k" in capsys.readouterr().out
    assert ["distance_drift_m_per_k:", "12.5e-3", "", "", "", "", "", "#", "m/K", "[src]"][1] in (
        folder / "sensor.yaml"
    ).read_text()


WALL = {"file": "08_wall.npz", "kind": "wall"}


@pytest.mark.parametrize(
    ("top", "sentence"),
    [
        ({"recordings": [WALL]}, "08_wall.npz: distance_m is missing; expected with kind wall"),
        (
            {"recordings": [{"file": "a.npz", "kind": "warm"}]},
            "a.npz: temperature_k is missing; expected with kind warm",
        ),
        (
            {"recordings": [{"file": "a.npz", "kind": "dark", "ambient": True}]},
            "a.npz: integration_s and gray_exposure_s is missing; expected with kind dark in "
            "ambient light",
        ),
        (
            {"recordings": [WALL | {"distance_m": 1.0}], "horizontal_fov_deg": None},
            "horizontal_fov_deg is missing; expected with the wall 08_wall.npz",
        ),
        ({"recordings": [{"file": "none.npz", "kind": "dark"}]}, "none.npz"),
        ({"recordings": [{"file": "a.npz", "kind": "bright"}]}, "kind"),
        ({"recordings": []}, "recordings"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_a_folder_that_cannot_be_used_is_refused_by_name(bench, tmp_path, capsys, top, sentence):
    folder = kept(bench, tmp_path / "bad", **top)
    assert calibrate(folder) != 0
    assert sentence in capsys.readouterr().err
    assert not (folder / "sensor.yaml").exists()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda dcs: dcs[:, :2], "00_dark.npz: 2 samples; expected 4 or 8"),
        (lambda dcs: dcs[:1], "00_dark.npz: 1 frame; expected at least 2"),
        (lambda dcs: dcs[:, :4], r"01_dark.npz: samples [n, H, W] are (8, 24, 32); expected"),
    ],
)
def test_recordings_that_do_not_fit_are_refused_by_name(bench, tmp_path, capsys, change, sentence):
    folder = kept(bench, tmp_path / "bad")
    with np.load(folder / "00_dark.npz") as arrays:
        np.savez(folder / "00_dark.npz", dcs=change(arrays["dcs"]))
    assert calibrate(folder) == 1
    assert sentence in capsys.readouterr().err


def test_the_sensor_is_a_yaml_file(bench, capsys):
    assert main(["camera", "calibrate", str(bench), "--out", str(bench / "sensor.json")]) == 2
    assert "expected a file that ends in .yaml" in capsys.readouterr().err
