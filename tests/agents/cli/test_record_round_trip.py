"""`shotenv record`, `shotenv bank import`, and the drives played again."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
import yaml
from camera_files import small_camera

from agents.cli.entry import main
from agents.evaluation import FIXED_POLICIES, make_envs, play_drives
from agents.policies import RandomPolicy, SnrTwoThresholdPolicy
from shotenv.config.env import EnvConfig
from shotenv.config.keywords import env_config
from shotenv.config.reader import merged, read_config
from shotenv.decision.acquire import acquire_depths
from shotenv.decision.features import FEATURE_NAMES
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import drive_of_seed
from unwrap.signal.shots import Shots

SEED, DRIVES, FRAMES = 3, 3, 24
POLICIES = {
    **FIXED_POLICIES,
    "rule": SnrTwoThresholdPolicy(FEATURE_NAMES, 0.3, 0.45),
    "random": RandomPolicy(1),
}
TWO = {"frequencies_hz": [24e6, 10e6]}


def succeed(*words):
    assert main([str(word) for word in words]) == 0


@pytest.fixture(scope="module")
def recorded(tiny_kwargs, session_cache, tmp_path_factory):
    """A folder with an environment, its drives as a camera records them, and the bank of these."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        folder = tmp_path_factory.mktemp("recorded")
        camera = small_camera(folder, "mlx75027", **TWO)
        config = env_config(**{**tiny_kwargs, "frames_per_drive": FRAMES}, split="test")
        (folder / "env.yaml").write_text(yaml.safe_dump(config.model_dump(mode="json")))
        words = ("--config", folder / "env.yaml", "--drives", DRIVES, "--seed", SEED)
        numbers = ("--json", folder / "numbers.json")
        succeed("record", *words, "--camera", camera, "--out", folder / "drives", *numbers)
        sensor = folder / "drives" / "sensor.yaml"
        words = (folder / "drives", "--camera", camera, "--sensor", sensor)
        succeed("bank", "import", *words, "--out", folder / "bank")
        yield folder


@pytest.fixture(scope="module")
def configs(recorded):
    """The environment that was recorded, and the one that plays the recordings."""
    simulated = read_config(EnvConfig, recorded / "env.yaml")
    written = read_config(EnvConfig, recorded / "bank" / "env.yaml")
    assert written.sensor == simulated.sensor and written.laser == simulated.laser
    assert written.frames_per_drive == FRAMES and written.split == "test"
    return simulated, merged(written, {"unwrapper": simulated.unwrapper})


def test_the_command_says_what_it_wrote(recorded):
    numbers = json.loads((recorded / "numbers.json").read_text())
    assert numbers["drives"] == DRIVES and numbers["frames"] == DRIVES * (FRAMES + 1)
    assert numbers["frequencies_hz"] == [24e6, 10e6]


def test_words_are_equal_to_the_bit(configs):
    before, after = map(open_problem, configs)
    seeds = [clip.seed for clip in after.bank.clips]
    assert [clip.name for clip in after.bank.clips] == ["000-drive_3", "001-drive_4", "002-drive_5"]
    for seed in seeds:
        drives = [drive_of_seed(problem, seed) for problem in (before, after)]
        for name in ("laser_power_w", "integration_s", "ambient_k", "start_k", "drift_m"):
            assert torch.equal(*(getattr(drive, name) for drive in drives)), name
        for frame in range(FRAMES + 1):
            step = torch.tensor([frame])
            taken = [
                acquire_depths(problem, drive, step, tuple(Shots))
                for problem, drive in zip((before, after), drives, strict=True)
            ]
            for one, other in zip(*taken, strict=True):
                assert torch.equal(one.raw.dcs_lsb, other.raw.dcs_lsb)
                assert torch.equal(one.raw.saturated, other.raw.saturated)
                assert torch.equal(one.depth.distance_m, other.depth.distance_m)


@pytest.mark.parametrize("name", POLICIES)
def test_returns_are_those_of_the_simulation(configs, name):
    seeds = range(SEED, SEED + DRIVES)
    before, after = (
        play_drives(POLICIES[name], make_envs(config, "test", DRIVES, "Disabled"), seeds)
        for config in configs
    )
    # Nothing was derated: recordings are of a laser at its full power.
    assert (before.shots > 0).all() and (before.shots == before.asked).all()
    for field in (
        "shots",
        "observations",
        "reward",
        "laser_energy_j",
        "depth_mae_m",
        "temperature_k",
    ):
        np.testing.assert_array_equal(getattr(before, field), getattr(after, field), err_msg=field)
    assert np.ptp(before.per_drive["return"]) > 0 or name == "always_4"


@pytest.mark.parametrize(
    ("words", "status", "error"),
    [
        (("--camera", "imx556"), 1, "frequencies are 24 and 10 MHz; expected 100 and 20 MHz"),
        (("--camera", "blaze"), 1, "blaze is described for simulation"),
        (("--camera", "epc660_wire", "--bank", "bank"), 1, "holds samples that a camera took"),
        (("--camera", "epc770"), 2, "camera is 'epc770'; expected one of"),
        (("--camera", "epc660_wire", "--drives", "0"), 2, "drives"),
    ],
)
def test_what_cannot_be_recorded_is_refused(recorded, words, status, error, capsys):
    words = [str(recorded / "bank") if word == "bank" else word for word in words]
    out = ("--out", str(recorded / "other"))
    assert main(["record", "--config", str(recorded / "env.yaml"), *words, *out]) == status
    assert error in capsys.readouterr().err.splitlines()[-1]
    assert not (recorded / "other").exists()
