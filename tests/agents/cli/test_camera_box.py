"""Every shipped camera, from what comes out of its box to a report."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
import torch

from agents.cli.entry import main
from agents.policies.learned import NetworkPolicy
from agents.policies.scheduler_files import Provenance
from agents.policies.score_networks import score_network
from shotenv.config.env import EnvConfig
from shotenv.config.reader import configs_dir, merged, read_config
from shotenv.decision.acquire import acquire_depth
from shotenv.decision.features import FEATURE_NAMES
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import drive_of_seed
from unwrap.signal.shots import Shots

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
OTHERS = ("kinect_v2", "blaze")
TELL_NO_NOISE = ("kinect_v2_dump", "phasor_video")
WITH_EIGHT = ("mlx75027", "imx556", "arducam_b0548", "kinect_v2_dump")
"""Those that take two frequencies or more; the MLX75027 in the description of one's own."""
SHORT = (
    "--study.drives 2 --study.tuning_drives 2 --study.bootstrap_draws 100 "
    "--study.prices [0.02,0.3] --study.families [cycle]"
)
DRIVES, FRAMES, SIZE = 4, 5, (24, 32)


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


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """One that has learned nothing, which is as much work to judge."""
    folder = tmp_path_factory.mktemp("scheduler")
    told = Provenance(algorithm="none", feature_names=FEATURE_NAMES, power_price=(0.01, 0.3))
    NetworkPolicy(score_network((len(FEATURE_NAMES), 3), "tanh"), told).save(folder)
    return folder


def four_of_first_frame(env_file, unwrapper):
    """Four samples of the first frame of a drive, corrected, and the truth beside them."""
    problem = open_problem(merged(read_config(EnvConfig, env_file), {"unwrapper": unwrapper}))
    drive, first = drive_of_seed(problem, 0), torch.tensor([0])
    return acquire_depth(problem, drive, first, Shots.FOUR)


def test_no_shipped_camera_is_forgotten():
    shipped = {path.stem for path in (configs_dir() / "camera").glob("*.yaml")}
    assert {*CAMERAS, *OTHERS} == shipped


@pytest.mark.parametrize("name", CAMERAS)
def test_from_the_box_to_a_report(made_up_camera, run, scheduler, tiny_unwrapper, tmp_path, name):
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

    bank = tmp_path / "bank"
    words = (box / "drives", "--camera", camera, "--sensor", sensor, "--out", bank)
    assert "truth        external, a reference" in run("bank", "import", *words)

    words = ("--env", bank / "env.yaml", "--env.unwrapper", tiny_unwrapper)
    run("evaluate", scheduler, *words, *SHORT.split(), "--out", tmp_path / "report")
    results = json.loads((tmp_path / "report" / "results.json").read_text())
    assert results["truth"] == "external"
    eight = name in WITH_EIGHT
    assert ("always_8" in results["policies"]) == eight
    if eight:
        # Two frequencies unwrap each other; the network of the others has learned nothing.
        assert results["policies"]["always_8"]["depth_mae_m"]["mean"] < 0.2
    four = four_of_first_frame(bank / "env.yaml", tiny_unwrapper)
    range_m = four.depth.unambiguous_m
    off_m = (four.depth.distance_m - four.truth_m + range_m / 2) % range_m - range_m / 2
    good = four.depth.valid & four.scored
    # The corridor's end is beyond what some cameras' frequencies unwrap, and is not scored.
    assert four.scored.float().mean() > 0.5
    assert good.sum() > 0.8 * four.scored.sum() and off_m[good].abs().median() < 0.03
    assert (tmp_path / "report" / "report.html").is_file()
