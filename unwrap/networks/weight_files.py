"""Network weights on disk: safetensors with metadata, written atomically, never unpickled.

Convolution kernels are stored as float16, normalisation in float32. The metadata holds what is
needed to build the network, where it comes from, and a SHA-256 of the tensors.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor, nn

from unwrap.networks.network import Network, Settings
from unwrap.networks.registry import build_network
from unwrap.networks.sizes import trained_size
from unwrap.support import in_one_line, require_regular, tensor_bytes, write_bytes

SCHEMA = "1"
"""Version of the metadata."""
MAX_BYTES = 1 << 28
"""Files larger than this are no networks of this project."""


@dataclass(frozen=True)
class Weights:
    """A network read from disk.

    Attributes
    ----------
    network : Network
        In evaluation mode, float32.
    metadata : dict
        What was stored with it.
    fingerprint : str
        SHA-256 of the tensors, hexadecimal.
    """

    network: Network
    metadata: dict[str, Any]
    fingerprint: str


@dataclass(frozen=True)
class WeightsLabel:
    """Which weights a file says that it holds, told without reading them.

    Attributes
    ----------
    network : str
        Name of the network.
    fingerprint : str
        As in `Weights`; compared with the tensors only when they are loaded.
    """

    network: str
    fingerprint: str


def save_weights(path: Path, network: nn.Module, metadata: Mapping[str, Any]) -> None:
    """Write the weights of `network` and `metadata` (plain JSON values) to `path`."""
    tensors = {
        name: tensor.detach().cpu().to(_stored_type(tensor))
        for name, tensor in network.state_dict().items()
    }
    values = {"schema": SCHEMA, "sha256": fingerprint(tensors), **metadata}
    # The metadata of a safetensors file is text alone.
    words = {
        key: value if isinstance(value, str) else json.dumps(value) for key, value in values.items()
    }
    write_bytes(path, tensor_bytes(tensors, words))


def _stored_type(tensor: Tensor) -> torch.dtype:
    # Kernels, which are nearly all of a file, lose nothing that matters in float16.
    half = tensor.is_floating_point() and tensor.ndim >= 2
    return torch.float16 if half else tensor.dtype


def fingerprint(tensors: Mapping[str, Tensor]) -> str:
    """SHA-256 over names, types, shapes and bytes of the tensors."""
    digest = hashlib.sha256()
    for name in sorted(tensors):
        tensor = tensors[name]
        digest.update(f"{name} {tensor.dtype} {tuple(tensor.shape)}".encode())
        digest.update(tensor.contiguous().numpy().tobytes())
    return digest.hexdigest()


def load_weights(path: Path) -> Weights:
    """Read a network.

    Raises
    ------
    ValueError
        The file is missing, damaged, no safetensors file, or no network of this project; the
        message names the file and the cure.
    """
    cure = "train it again (`shotenv unwrap train`) or fetch it again"
    try:
        # First of all: all tensors are read for the checksum, however large they are.
        require_regular(path, MAX_BYTES)
        with safe_open(path, framework="pt") as file:
            words = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        return _built(words, tensors)
    except (ValueError, TypeError, KeyError, OSError, RuntimeError, SafetensorError) as error:
        reason = in_one_line(error)
        raise ValueError(f"{path}: unusable network file ({reason}); {cure}") from None


def read_label(path: Path) -> WeightsLabel:
    """Label of the file of weights at `path`.

    Raises
    ------
    ValueError
        The file is missing, no safetensors file, or no network of this project.
    """
    try:
        require_regular(path, MAX_BYTES)
        with safe_open(path, framework="pt") as file:
            words = dict(file.metadata() or {})
        return WeightsLabel(words["network"], words["sha256"])
    except (KeyError, OSError, ValueError, SafetensorError) as error:
        raise ValueError(f"{path}: unusable network file ({in_one_line(error)})") from None


def _built(words: Mapping[str, str], tensors: Mapping[str, Tensor]) -> Weights:
    """The network of a file's metadata and tensors; raises where they do not fit together."""
    if words.get("schema") != SCHEMA:
        raise ValueError(f"schema is {words.get('schema')!r}; expected {SCHEMA!r}")
    digest = fingerprint(tensors)
    if words["sha256"] != digest:
        raise ValueError("its tensors do not match its checksum")
    metadata = {key: _value(word) for key, word in words.items()}
    trained_size(metadata)  # Refused here rather than at the first frame.
    network = build_network(metadata["network"], Settings.of(metadata))
    for name, value in network.state_dict().items():
        # Loading would take the real part of complex numbers, and whole numbers as they are.
        if name in tensors and tensors[name].dtype != _stored_type(value):
            raise ValueError(f"{name} is {tensors[name].dtype}; expected {_stored_type(value)}")
        if name in tensors and not tensors[name].isfinite().all():
            raise ValueError(f"{name} is not finite")
    # The network was built in float32, and values that are loaded take its type.
    network.load_state_dict(tensors)
    return Weights(network.eval(), metadata, digest)


def _value(word: str) -> Any:
    """JSON, or text such as a name, which `save_weights` stores as it is."""
    try:
        return json.loads(word)
    except ValueError:
        return word
