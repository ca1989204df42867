"""A trained network made ready to predict: the same function in fewer operations."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from functools import cached_property
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from unwrap.networks.network import Network, arithmetic, autocast, multiply_accumulates
from unwrap.networks.openvino import Program, can_compile

Convolution = nn.Conv2d | nn.ConvTranspose2d
WORTH_COMPILING_MACS = 10**8
"""Multiply-accumulates of a frame from which on a second of compiling pays."""


class Prepared:
    """A trained network made ready to predict on a device: `forward`, for predictions alone.

    On a processor a program of OpenVINO for each size of frames, where that is installed, the
    network can be compiled and is large enough; otherwise a `folded` copy. Which of them it is does
    not depend on how many frames there are, so that a frame is always predicted alike. Either runs
    on as many threads as torch had when this was made.
    """

    def __init__(self, network: Network, device: torch.device):
        self._network, self._device = network, device
        self._threads = torch.get_num_threads()
        self._forwards: dict[torch.Size, Callable[[Tensor], Tensor]] = {}

    def __call__(self, features: Tensor) -> Tensor:
        """What the network computes of `features` [B, C, H, W]; see `Network.features`."""
        if features.shape not in self._forwards:
            self._forwards[features.shape] = self._forward_of(features)
        with torch_threads(self._threads):
            return self._forwards[features.shape](features)

    def _forward_of(self, features: Tensor) -> Callable[[Tensor], Tensor]:
        if not (self._device.type == "cpu" and can_compile() and self._network.can_be_traced):
            return self._folded
        if multiply_accumulates(self._network, features) < WORTH_COMPILING_MACS:
            return self._folded
        return Program(self._network, features, arithmetic(self._device), self._threads)

    @cached_property
    def _folded(self) -> Callable[[Tensor], Tensor]:
        network = folded(self._network, self._device)

        def forward(features: Tensor) -> Tensor:
            with autocast(self._device):
                return network(features)

        return forward


@contextmanager
def torch_threads(count: int) -> Iterator[None]:
    """Torch computes with `count` threads inside the context."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def folded(network: Network, device: torch.device) -> Network:
    """A copy of `network` on `device` that predicts alike, but for rounding.

    Normalisations are folded into the convolutions before them (in evaluation mode they are
    affine), weights have the type that is computed with, so that they are not converted for every
    frame, and rectifiers overwrite their input.
    """
    copy = deepcopy(network).to(device).eval()
    for block in list(copy.modules()):
        if isinstance(block, nn.Sequential):
            _fold(block)
    for layer in copy.modules():
        if isinstance(layer, Convolution):
            layer.to(arithmetic(device))
        elif isinstance(layer, nn.ReLU):
            layer.inplace = True
    return copy.to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def _fold(block: nn.Sequential) -> None:
    """Replace each convolution and normalisation that follow each other by one convolution."""
    for (name, layer), (next_name, norm) in pairwise(list(block.named_children())):
        if isinstance(layer, Convolution) and isinstance(norm, nn.BatchNorm2d):
            transposed = isinstance(layer, nn.ConvTranspose2d)
            setattr(block, name, fuse_conv_bn_eval(layer, norm, transpose=transposed))
            setattr(block, next_name, nn.Identity())
