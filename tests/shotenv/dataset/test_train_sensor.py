"""Networks for another sensor than the bank's: of the gray image on any, of samples on its own."""

from __future__ import annotations

import json
import shlex

import pytest
import torch

from agents.cli import main
from shotenv.bank import open_bank
from shotenv.config import BankConfig, SensorConfig, env_config, find_config, read_config
from shotenv.dataset import SensedFrames, for_sensor, sources
from shotenv.dataset.source import rendering
from unwrap.networks import load_unwrapper
from unwrap.signal import Shots
from unwrap.training import TrainConfig

TINY = ("--width", "4", "--epochs", "1", "--batch_size", "4")


def trained(out, *words):
    return main(["unwrap", "train", *words, *TINY, "--out", str(out)])


@pytest.mark.parametrize("network", ["tofsegnet", "tofregnet"])
def test_a_network_of_the_gray_image_needs_no_other_bank(network, tiny_bank, tmp_path, capsys):
    words = ("--network", network, "--bank", tiny_bank, "--sensor", "mlx75027")
    assert trained(tmp_path, *words) == 0
    said = capsys.readouterr()
    assert f"{network} for 60 MHz: wraps of 2.5 m, up to 25 m" in said.out
    assert "are those of sensor epc660, which mlx75027 differs from in" in said.err
    unwrapper = load_unwrapper(str(tmp_path / f"{network}.safetensors"))
    assert unwrapper.metadata["f1_hz"] == 60e6
    assert unwrapper.unambiguous_m == pytest.approx(2.498, abs=1e-3)
    # Eleven wraps of 2.498 m begin within 25 m.
    assert unwrapper.network.settings.classes == (11 if network == "tofsegnet" else 5)
    numbers = json.loads((tmp_path / f"{network}.json").read_text())
    assert numbers["config"]["f1_hz"] == 60e6 and numbers["config"]["sensor"] == "mlx75027"


def test_labels_are_those_of_the_sensor(tiny_bank):
    """The same frames, at 24 and at 60 MHz: the same gray images and distances."""
    configs = [
        for_sensor(TrainConfig(network="tofsegnet", bank=tiny_bank, sensor=sensor))
        for sensor in ("epc660", "mlx75027")
    ]
    near, far = (sources(config)("train") for config in configs)
    assert (near.sensor.f1_hz, far.sensor.f1_hz) == (24e6, 60e6)
    (gray, truth), (again, same) = (f.batch([0, 3], draw=1, shots=None) for f in (near, far))
    assert torch.equal(gray.gray, again.gray) and torch.equal(truth.distance_m, same.distance_m)
    with pytest.raises(ValueError, match=r"f1_hz is 6e\+07, but bank tiny was rendered with 2.4e"):
        far.batch([0], draw=1, shots=Shots.FOUR)


def test_a_network_of_samples_is_told_which_bank_to_render(tiny_bank, tmp_path, capsys):
    words = ("--network", "toffusionnet", "--bank", tiny_bank)
    assert trained(tmp_path, *words, "--sensor", "mlx75027") == 1
    said = capsys.readouterr().err
    assert "render a bank with this sensor: shotenv render --config tiny.yaml --sensor" in said
    # Nor can the distance that eight samples measure be had of another frequency.
    gray = ("--network", "tofregnet", "--truth", "measured", "--bank", tiny_bank)
    assert trained(tmp_path, *gray, "--sensor", "mlx75027") == 1
    assert "shotenv render" in capsys.readouterr().err
    assert trained(tmp_path, *words, "--f1_hz", "60e6") == 1
    assert "f1_hz is 6e+07, but sensor epc660 samples at 2.4e+07" in capsys.readouterr().err


def test_the_command_renders_the_same_worlds_for_the_sensor(monkeypatch):
    asked = []
    monkeypatch.setattr("shotenv.bank.build_bank", lambda *what, **how: asked.append(what))
    starter = read_config(BankConfig, find_config("bank", "starter"))
    command = shlex.split(rendering(starter, "mlx75027"))
    assert command[0] == "shotenv" and command[-2:] == ["--out", "starter-mlx75027"]
    assert main(command[1:]) == 0
    (config, out), mlx = asked[0], read_config(SensorConfig, find_config("sensor", "mlx75027"))
    assert config == starter.model_copy(update={"sensor": mlx, "name": "starter-mlx75027"})
    assert str(out) == "starter-mlx75027"


def test_a_network_of_samples_learns_on_a_bank_of_its_sensor(write_bank, tmp_path):
    sensor = read_config(SensorConfig, find_config("sensor", "mlx75027"))
    write_bank(tmp_path / "bank", sensor)
    words = ("--network", "toffusionnet", "--bank", str(tmp_path / "bank"))
    assert trained(tmp_path, *words, "--sensor", "mlx75027") == 0
    unwrapper = load_unwrapper(str(tmp_path / "toffusionnet.safetensors"))
    config = env_config(sensor="mlx75027", bank=str(tmp_path / "bank"))
    bank = open_bank(config.bank)
    frames = SensedFrames(bank, bank.frames("test"), config, range_m=30.0)
    sensed, _ = frames.batch([0], draw=0, shots=Shots.FOUR)
    found = unwrapper.predict_sensed(sensed, frames.sensor)
    assert found.distance_m.shape == (1, 24, 32)


def test_what_is_chosen_stays():
    config = TrainConfig(network="tofsegnet", sensor="mlx75027", max_range_m=12.0, clamp_m=14.0)
    found = for_sensor(config)
    assert (found.f1_hz, found.max_range_m, found.clamp_m, found.classes) == (60e6, 12.0, 14.0, 5)
    assert for_sensor(TrainConfig()) == TrainConfig()


def test_more_wraps_than_classes_are_refused(tmp_path):
    text = find_config("sensor", "mlx75027").read_text(encoding="utf-8")
    for old, new in (("60.0e6", "100.0e6"), ("25.0e6", "95.0e6"), ("_m: 2.48", "_m: 1.4")):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "fast.yaml").write_text(text)
    config = TrainConfig(network="tofsegnet", sensor=str(tmp_path / "fast.yaml"))
    with pytest.raises(ValueError, match=r"17 wraps of 1.5 m begin; expected at most 16"):
        for_sensor(config)
    assert for_sensor(config.model_copy(update={"network": "tofregnet"})).f1_hz == 100e6
