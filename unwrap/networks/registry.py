"""All networks by name. Each is imported when it is asked for.

To add a network, write its class (`unwrap.networks.network.Network` says what it must have) in a
file of this room or of `peers`, and give it one line in `PLACES`. Training, evaluation, the results
table, export and the command line then know it by that name.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Literal

from unwrap.networks.network import Network, Settings
from unwrap.support import require_choice

PLACES = {
    "tofregnet": "unwrap.networks.tofregnet:TofRegNet",
    "tofsegnet": "unwrap.networks.tofsegnet:TofSegNet",
    "toffusionnet": "unwrap.networks.toffusionnet:TofFusionNet",
    "su_net": "unwrap.networks.peers.su:SuNet",
    "phasenet": "unwrap.networks.peers.phasenet:PhaseNet",
    "agresti_net": "unwrap.networks.peers.agresti:AgrestiNet",
    "chen_net": "unwrap.networks.peers.chen:ChenNet",
}
"""Module and class of each network: strings, so that a name alone imports nothing."""

if TYPE_CHECKING:
    NetworkName = str
else:
    # What pydantic and the command line check names with. It is made of the table, which type
    # checkers cannot follow, so that a name is written down once.
    NetworkName = Literal[tuple(PLACES)]


def network_class(name: str) -> type[Network]:
    """Class of a network.

    Raises
    ------
    ValueError
        There is none of that name.
    """
    require_choice(PLACES, network=name)
    module, _, attribute = PLACES[name].partition(":")
    return getattr(import_module(module), attribute)


def build_network(name: str, settings: Settings) -> Network:
    """An untrained network, its weights drawn from torch's global generator.

    Raises
    ------
    ValueError
        There is none of that name.

    Examples
    --------
    >>> network = build_network("tofregnet", Settings(width=4, range_m=12.0)).eval()
    >>> network(network.example(32, 32)).shape
    torch.Size([1, 32, 32])
    """
    return network_class(name).from_settings(settings)
