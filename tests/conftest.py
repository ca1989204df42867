"""A tiny bank and an untrained network: what tests of sensor, environment and agents stand on."""

from __future__ import annotations

import signal

import pytest
import torch
from hypothesis import settings
from tiny_banks import SPEED_OF_LIGHT_M_S, write_tiny_bank

from shotenv.config.reader import find_config, read_config
from shotenv.config.sensor import SensorConfig
from unwrap.networks.tofregnet import TofRegNet
from unwrap.networks.weight_files import save_weights

# Property tests draw the same examples each time, so that no run fails that passed before;
# `--hypothesis-profile long` draws many more, anew each time.
settings.register_profile(
    "everyday", max_examples=60, derandomize=True, deadline=None, database=None
)
settings.register_profile("long", max_examples=10_000, deadline=None, database=None)
settings.load_profile("everyday")


@pytest.fixture(autouse=True, scope="session")
def ctrl_c_interrupts():
    """Also where the tests were started in the background of a script, which ignores Ctrl-C."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(autouse=True, scope="session")
def _one_thread():
    """Tensors here are small: threads would only wait for each other."""
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def sensor() -> SensorConfig:
    return read_config(SensorConfig, find_config("sensor", "epc660"))


@pytest.fixture(scope="session")
def session_cache(tmp_path_factory) -> str:
    """Cache folder of the whole test session; nothing is written into the user's own."""
    return str(tmp_path_factory.mktemp("cache"))


@pytest.fixture(autouse=True)
def _own_cache(session_cache, monkeypatch):
    monkeypatch.setenv("SHOTENV_CACHE", session_cache)


@pytest.fixture(scope="session")
def tiny_bank(tmp_path_factory, sensor) -> str:
    """Path of a bank: 16 clips of 4 frames, 32 x 24 pixels, five families, three splits."""
    folder = tmp_path_factory.mktemp("banks") / "tiny"
    write_tiny_bank(folder, sensor)
    return str(folder)


@pytest.fixture(scope="session")
def write_bank():
    """Writes a bank as the tiny one into a folder, of another sensor."""
    return write_tiny_bank


@pytest.fixture(scope="session")
def tiny_unwrapper(tmp_path_factory, sensor) -> str:
    """Path of an untrained TofRegNet of width 4; fast, and wrong in a fixed way."""
    torch.manual_seed(0)
    path = tmp_path_factory.mktemp("weights") / "tiny.safetensors"
    # Untrained outputs lie about the middle of the range; this puts them about the first wrap,
    # and the stronger head spreads them.
    range_m = SPEED_OF_LIGHT_M_S / sensor.f1_hz
    network = TofRegNet(width=4, range_m=range_m)
    network.head.weight.data.mul_(30.0)
    network.head.bias.data.zero_()
    metadata = {"network": "tofregnet", "width": 4, "range_m": range_m, "f1_hz": sensor.f1_hz}
    save_weights(path, network, metadata)
    return str(path)


@pytest.fixture(scope="session")
def tiny_kwargs(tiny_bank, tiny_unwrapper) -> dict[str, object]:
    """Keyword arguments of an environment on the tiny bank."""
    return {"bank": tiny_bank, "unwrapper": tiny_unwrapper, "frames_per_drive": 32}
