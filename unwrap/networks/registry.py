"""All networks by name. Peers are loaded when they are asked for."""

from __future__ import annotations

from importlib import import_module
from typing import get_args

from unwrap.networks.network import Network, NetworkName, Settings

NAMES: tuple[str, ...] = get_args(NetworkName)
_PLACES = {
    "tofregnet": "unwrap.networks.tofregnet:TofRegNet",
    "tofsegnet": "unwrap.networks.tofsegnet:TofSegNet",
    "toffusionnet": "unwrap.networks.toffusionnet:TofFusionNet",
    "su_net": "unwrap.networks.peers.su:SuNet",
    "phasenet": "unwrap.networks.peers.phasenet:PhaseNet",
    "agresti_net": "unwrap.networks.peers.agresti:AgrestiNet",
    "chen_net": "unwrap.networks.peers.chen:ChenNet",
}


def network_class(name: str) -> type[Network]:
    """Class of a network.

    Raises
    ------
    ValueError
        There is none of that name.
    """
    if name not in _PLACES:
        raise ValueError(f"network is {name!r}; expected one of {', '.join(NAMES)}")
    module, _, attribute = _PLACES[name].partition(":")
    return getattr(import_module(module), attribute)


def build(name: str, settings: Settings) -> Network:
    """An untrained network, see `network_class`."""
    return network_class(name).build(settings)
