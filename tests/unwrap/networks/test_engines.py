import sys

import pytest
import torch
from torch import nn
from unwrap_source import SENSOR, Walls

from unwrap.networks import engines as inference
from unwrap.networks.engines import Prepared, folded
from unwrap.networks.network import Settings, arithmetic, autocast
from unwrap.networks.openvino import Program
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.registry import NAMES, build
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.weight_files import save_weights
from unwrap.signal.shots import Shots

CPU = torch.device("cpu")


def trained(name):
    """A network whose normalisations do something."""
    torch.manual_seed(1)
    network = build(name, Settings(width=8)).eval()
    for norm in (m for m in network.modules() if isinstance(m, nn.BatchNorm2d)):
        for values, low, high in (
            (norm.running_mean, -0.2, 0.2),
            (norm.running_var, 0.5, 2.0),
            (norm.weight.data, 0.5, 1.5),
            (norm.bias.data, -0.2, 0.2),
        ):
            values.uniform_(low, high)
    return network


@pytest.mark.parametrize("name", NAMES)
@torch.inference_mode()
def test_a_folded_network_computes_the_same(name, monkeypatch):
    monkeypatch.setattr(inference, "arithmetic", lambda device: torch.float32)
    network = trained(name)
    ready = folded(network, CPU)
    sensed, _ = Walls(2).batch([0, 1], draw=0, shots=Shots.FOUR)
    features = network.features(sensed, SENSOR)
    before = features.clone()
    apart = (ready(features) - network(features)).abs()
    # PhaseNet unpools to where the largest value was; rounding breaks a tie another way.
    assert apart.mean() < 1e-4
    assert (apart < 1e-4).float().mean() > 0.95
    assert torch.equal(features, before)


def test_a_folded_network_normalises_nothing_and_leaves_the_network_alone():
    network = trained("tofregnet")
    weights = {name: tensor.clone() for name, tensor in network.state_dict().items()}
    ready = folded(network, CPU)
    assert not any(isinstance(layer, nn.BatchNorm2d) for layer in ready.modules())
    convolutions = [layer for layer in ready.modules() if isinstance(layer, nn.Conv2d)]
    assert {layer.weight.dtype for layer in convolutions} == {arithmetic(CPU)}
    assert all(torch.equal(weights[name], tensor) for name, tensor in network.state_dict().items())


TRACED = [name for name in NAMES if build(name, Settings(width=4)).can_be_traced]


@pytest.mark.parametrize("name", TRACED)
@torch.inference_mode()
def test_a_program_computes_the_same(name):
    network = trained(name)
    sensed, _ = Walls(2).batch([0, 1], draw=0, shots=Shots.FOUR)
    features = network.features(sensed, SENSOR)
    program = Program(network, features[:1], torch.float32, 1)
    before = features.clone()
    for frame in (features[:1], features[1:]):
        assert torch.allclose(program(frame), network(frame), atol=1e-3)
    assert torch.equal(features, before)
    assert sys.modules["openvino_telemetry"] is None  # Nothing is told to anybody.


def test_all_but_phasenet_can_be_traced():
    assert set(NAMES) - set(TRACED) == {"phasenet"}


@pytest.mark.parametrize("installed", [True, False])
@torch.inference_mode()
def test_large_networks_become_programs_where_openvino_is_installed(installed, monkeypatch):
    network, features = trained("tofregnet"), torch.rand(1, 1, 64, 96)
    monkeypatch.setattr(inference, "can_compile", lambda: installed)
    monkeypatch.setattr(inference, "arithmetic", lambda device: torch.float32)
    made = []
    monkeypatch.setattr(inference, "Program", lambda *a: made.append(a) or Program(*a))
    assert torch.allclose(Prepared(network, CPU)(features), network(features), atol=0.5)
    assert not made
    monkeypatch.setattr(inference, "WORTH_COMPILING_MACS", 0)
    ready = Prepared(network, CPU)
    first = ready(features)
    ready(features)
    assert torch.equal(ready(features), first)
    assert len(made) == installed


def test_an_unwrapper_predicts_what_its_network_computes(tmp_path):
    torch.manual_seed(0)
    metadata = {"network": "tofregnet", "width": 8, "f1_hz": 24e6}
    save_weights(tmp_path / "net.safetensors", TofRegNet(8), metadata)
    unwrapper, gray = load_unwrapper(tmp_path / "net.safetensors"), torch.rand(2, 64, 64)
    with torch.inference_mode(), autocast(CPU):
        expected_m = unwrapper.network(gray[:, None])
    apart_m = (unwrapper.predict(gray).distance_m - expected_m).abs()
    assert apart_m.mean() < 0.1
    assert apart_m.max() < 1.0
