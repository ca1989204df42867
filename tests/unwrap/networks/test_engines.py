"""Networks made ready to predict compute what they computed before."""

import sys

import pytest
import torch
from torch import nn
from unwrap_source import SENSOR, Walls

from unwrap.networks import engines
from unwrap.networks.engines import Engine, Engines, fused_copy
from unwrap.networks.network import Settings, arithmetic, autocast
from unwrap.networks.openvino import CompiledNetwork
from unwrap.networks.predictor import load_unwrapper
from unwrap.networks.registry import PLACES, build_network
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.weight_files import save_weights
from unwrap.signal.shots import Shots

CPU = torch.device("cpu")


def network_of(name):
    """A network whose normalisations do something."""
    torch.manual_seed(1)
    network = build_network(name, Settings(width=8)).eval()
    for norm in (m for m in network.modules() if isinstance(m, nn.BatchNorm2d)):
        for values, low, high in (
            (norm.running_mean, -0.2, 0.2),
            (norm.running_var, 0.5, 2.0),
            (norm.weight.data, 0.5, 1.5),
            (norm.bias.data, -0.2, 0.2),
        ):
            values.uniform_(low, high)
    return network


@pytest.mark.parametrize("name", PLACES)
@torch.inference_mode()
def test_a_fused_network_computes_the_same(name, monkeypatch):
    monkeypatch.setattr(engines, "arithmetic", lambda device: torch.float32)
    network = network_of(name)
    ready = fused_copy(network, CPU)
    sensed, _ = Walls(2).batch([0, 1], draw=0, shots=Shots.FOUR)
    features = network.features(sensed, SENSOR)
    before = features.clone()
    apart = (ready(features) - network(features)).abs()
    # PhaseNet unpools to where the largest value was; rounding breaks a tie another way.
    assert apart.mean() < 1e-4
    assert (apart < 1e-4).float().mean() > 0.95
    assert torch.equal(features, before)


def test_a_fused_network_normalises_nothing_and_leaves_the_network_alone():
    network = network_of("tofregnet")
    weights = {name: tensor.clone() for name, tensor in network.state_dict().items()}
    ready = fused_copy(network, CPU)
    assert not any(isinstance(layer, nn.BatchNorm2d) for layer in ready.modules())
    convolutions = [layer for layer in ready.modules() if isinstance(layer, nn.Conv2d)]
    assert {layer.weight.dtype for layer in convolutions} == {arithmetic(CPU)}
    assert all(torch.equal(weights[name], tensor) for name, tensor in network.state_dict().items())


EVERYDAY = ("tofregnet", "toffusionnet")
TRACED = [name for name in PLACES if build_network(name, Settings(width=4)).can_be_traced]


# Each takes two seconds to compile: every day one for gray and one for samples.
@pytest.mark.parametrize(
    "name",
    [name if name in EVERYDAY else pytest.param(name, marks=pytest.mark.slow) for name in TRACED],
)
@torch.inference_mode()
def test_a_compiled_network_computes_the_same(name):
    network = network_of(name)
    sensed, _ = Walls(2).batch([0, 1], draw=0, shots=Shots.FOUR)
    features = network.features(sensed, SENSOR)
    compiled = CompiledNetwork(network, features[:1], torch.float32, 1)
    before = features.clone()
    for frame in (features[:1], features[1:]):
        assert torch.allclose(compiled(frame), network(frame), atol=1e-3)
    assert torch.equal(features, before)
    assert sys.modules["openvino_telemetry"] is None  # Nothing is told to anybody.


def test_all_but_phasenet_can_be_traced():
    assert set(PLACES) - set(TRACED) == {"phasenet"}


@pytest.mark.parametrize("installed", [True, False])
@torch.inference_mode()
def test_large_networks_are_compiled_where_openvino_is_installed(installed, monkeypatch):
    network, features = network_of("tofregnet"), torch.rand(1, 1, 64, 96)
    monkeypatch.setattr(engines, "can_compile", lambda: installed)
    monkeypatch.setattr(engines, "arithmetic", lambda device: torch.float32)
    made = []
    monkeypatch.setattr(
        engines, "CompiledNetwork", lambda *a: made.append(a) or CompiledNetwork(*a)
    )
    assert torch.allclose(Engine(network, CPU)(features), network(features), atol=0.5)
    assert not made
    monkeypatch.setattr(engines, "WORTH_COMPILING_MACS", 0)
    ready = Engine(network, CPU)
    first = ready(features)
    ready(features)
    assert torch.equal(ready(features), first)
    assert len(made) == installed


def test_engines_are_kept_and_know_their_device():
    made = Engines(network_of("tofregnet"))
    assert made.on(CPU) is made.on(CPU)
    assert made.on(torch.device("meta")) is not made.on(CPU)


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
