"""Networks by name: all are in the table, and nothing else can be built."""

import ast
from importlib import import_module
from pathlib import Path
from typing import get_args

import pytest
from pydantic import ValidationError

import unwrap.networks
from unwrap.networks.network import Network, Settings
from unwrap.networks.registry import PLACES, NetworkName, build_network, network_class
from unwrap.training.config import TrainConfig

ROOM = Path(unwrap.networks.__file__).parent
PARTS = {"Network", "Autoencoder", "GrayNetwork"}
"""Classes that networks are made of."""


def test_every_network_of_the_room_is_in_the_table():
    defined = set()
    for path in ROOM.rglob("*.py"):
        module = ".".join(("unwrap.networks", *path.relative_to(ROOM).with_suffix("").parts))
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                found = getattr(import_module(module), node.name)
                if issubclass(found, Network) and node.name not in PARTS:
                    defined.add(found)
    assert defined == {network_class(name) for name in PLACES}


def test_names_are_those_of_the_table():
    assert get_args(NetworkName) == tuple(PLACES)
    for name in PLACES:
        assert TrainConfig(network=name).network == name
    with pytest.raises(ValidationError, match="'tofregnet', 'tofsegnet'"):
        TrainConfig(network="unet")


@pytest.mark.parametrize("name", PLACES)
def test_settings_reach_the_network(name):
    network = build_network(name, Settings(width=6))
    assert type(network) is network_class(name)
    assert network.settings.width == 6


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        ({"network": "resnet", "width": 4}, "network"),
        ({"network": "tofregnet", "width": 1_000_000, "range_m": 30}, "width"),
        ({"network": "tofregnet", "width": "4", "range_m": 30}, "width"),
        ({"network": "tofsegnet", "width": 4, "classes": 10**9}, "classes"),
    ],
)
def test_build_refuses_impossible_networks(metadata, message):
    with pytest.raises(ValueError, match=message):
        build_network(metadata["network"], Settings.of(metadata))
