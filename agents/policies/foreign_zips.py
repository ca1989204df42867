"""Networks out of stable-baselines3's zips, without unpickling what is in them.

`model.save` writes how the model was made as pickles, which may be of any class: loading them as
stable-baselines3 does runs whatever code they name. The weights are a file of their own, which
torch reads as tensors alone, and their names and shapes tell the network.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from pathlib import Path
from typing import Any, Final, NamedTuple

import torch
from torch import Tensor, nn

from agents.policies.scheduler_files import DEEPEST, WIDEST, first_line
from agents.policies.score_networks import (
    ACTIVATIONS,
    Activation,
    linear_layers,
    mean_of_quantiles,
    score_network,
)
from unwrap.signal import Shots

WEIGHTS_OF_ZIP: Final = "policy.pth"
TOLD_OF_ZIP: Final = "data"
LARGEST: Final = 2**26
"""Bytes that either may unpack to (assumed): networks of features are a thousandth of that."""


class Kind(NamedTuple):
    """Algorithms whose networks are named alike.

    Attributes
    ----------
    name : str
    layers : str
        Of the hidden layers, and of all but PPO's the last one, up to their number.
    last : str
        Of the last layer, where it stands apart.
    unused : tuple of str
        How parts begin that choose nothing, as a critic.
    activation : str
        Between the layers, unless the zip tells of another.
    """

    name: str
    layers: str
    last: str
    unused: tuple[str, ...]
    activation: Activation


KINDS: Final = (
    Kind(
        "ppo or a2c",
        "mlp_extractor.policy_net",
        "action_net",
        ("mlp_extractor.value_net.", "value_net."),
        "tanh",
    ),
    Kind("dqn", "q_net.q_net", "", ("q_net_target.q_net.",), "relu"),
    Kind("qrdqn", "quantile_net.quantile_net", "", ("quantile_net_target.quantile_net.",), "relu"),
)


def network_of_zip(path: Path) -> tuple[nn.Sequential, str]:
    """The network that chooses in a zip that PPO, A2C, DQN or QR-DQN saved, and its kind.

    Nothing is unpickled but tensors (`torch.load` with `weights_only`).

    Raises
    ------
    ValueError
        It is no such zip, damaged, or of another kind of network; the message names the file.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            weights = _tensors(_content(archive, WEIGHTS_OF_ZIP))
            told = json.loads(_content(archive, TOLD_OF_ZIP))
        return _network(weights, told)
    # Zips, torch's files and JSON each have errors of their own.
    except Exception as error:
        raise ValueError(
            f"{path} is not a usable zip of stable-baselines3: {first_line(error)}"
        ) from None


def _content(archive: zipfile.ZipFile, name: str) -> bytes:
    if name not in archive.namelist():
        raise ValueError(f"it has no {name}")
    with archive.open(name) as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise ValueError(f"{name} is larger than {LARGEST} bytes")
    return content


def _tensors(content: bytes) -> dict[str, Tensor]:
    with zipfile.ZipFile(io.BytesIO(content)) as parts:
        if sum(part.file_size for part in parts.infolist()) > LARGEST:
            raise ValueError(f"{WEIGHTS_OF_ZIP} unpacks to more than {LARGEST} bytes")
    weights = torch.load(io.BytesIO(content), map_location="cpu", weights_only=True)
    if not isinstance(weights, dict) or not all(isinstance(x, Tensor) for x in weights.values()):
        raise ValueError(f"{WEIGHTS_OF_ZIP} holds something else than named tensors")
    return weights


def _network(weights: dict[str, Tensor], told: Any) -> tuple[nn.Sequential, str]:
    kind, names = _layers(weights)
    matrices = [weights[f"{name}.weight"] for name in names]
    outputs = [tuple(matrix.shape) for matrix in matrices]
    if any(len(shape) != 2 for shape in outputs) or len(outputs) > DEEPEST:
        raise ValueError(f"its layers are {outputs}; expected at most {DEEPEST} linear ones")
    widths = (outputs[0][1], *(shape[0] for shape in outputs))
    quantiles, rest = divmod(widths[-1], len(Shots)) if kind.name == "qrdqn" else (1, 0)
    # The last layer of quantiles is wider, by their number.
    if rest or not quantiles or max((*widths[:-1], quantiles)) > WIDEST:
        raise ValueError(f"its layers have widths {widths}; expected at most {WIDEST}")
    network = score_network(widths, _activation(told, kind))
    for layer, name in zip(linear_layers(network), names, strict=True):
        # Refuses what does not fit in between.
        layer.load_state_dict({part: weights[f"{name}.{part}"] for part in ("weight", "bias")})
    if not all(value.isfinite().all() for value in network.parameters()):
        raise ValueError("not all weights are finite")
    return (mean_of_quantiles(network, quantiles) if quantiles > 1 else network), kind.name


def _layers(weights: dict[str, Tensor]) -> tuple[Kind, list[str]]:
    """What a zip is of, and the names of the layers from features to actions."""
    for kind in KINDS:
        form = rf"({re.escape(kind.layers)}\.(\d+))\.(weight|bias)"
        found = {name: match for name in weights if (match := re.fullmatch(form, name))}
        names = [each for _, each in sorted({(int(m[2]), m[1]) for m in found.values()})]
        names += [kind.last] if kind.last and f"{kind.last}.weight" in weights else []
        if not names or (kind.last and names[-1] != kind.last):
            continue
        own = {f"{name}.{part}" for name in names for part in ("weight", "bias")}
        others = [name for name in weights if name not in own and not name.startswith(kind.unused)]
        if others:
            raise ValueError(
                f"it has {others[0]}, too; expected the {kind.name} of three actions that reads "
                "the features as they are"
            )
        return kind, names
    known = ", ".join(kind.name for kind in KINDS)
    raise ValueError(f"its network has {', '.join(list(weights)[:3])}; expected that of {known}")


def _activation(told: Any, kind: Kind) -> Activation:
    """The activation that the zip tells of in words, or the kind's own."""
    arguments = told.get("policy_kwargs") if isinstance(told, dict) else None
    if not isinstance(arguments, dict):
        raise ValueError(f"{TOLD_OF_ZIP} does not tell policy_kwargs")
    named = arguments.get("activation_fn")
    if named is None:
        return kind.activation
    for activation, module in ACTIVATIONS.items():
        if str(named) == str(module):
            return activation
    raise ValueError(f"activation_fn is {named}; expected {' or '.join(ACTIVATIONS)}")
