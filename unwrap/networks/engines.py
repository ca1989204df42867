"""Engines: a trained network made ready to predict, the same function in fewer operations."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import cached_property
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from unwrap.networks.network import Network, arithmetic, autocast, multiply_accumulates
from unwrap.networks.openvino import CompiledNetwork, can_compile
from unwrap.support import torch_threads

Convolution = nn.Conv2d | nn.ConvTranspose2d
WORTH_COMPILING_MACS = 10**8
"""Multiply-accumulates of a frame from which on a second of compiling pays."""


class Engine:
    """A trained network made ready to predict on a device: `forward`, for predictions alone.

    On a processor a network compiled by OpenVINO for each size of frames, where that is installed,
    the network can be traced and is large enough; otherwise a fused copy (`fused_copy`). Which of
    them it is does not depend on how many frames there are, so that a frame is always predicted
    alike. Either runs on as many threads as torch had when the engine was made.
    """

    def __init__(self, network: Network, device: torch.device):
        self._network, self._device = network, device
        # Now, since whoever calls may have turned torch down to one thread for what is around it.
        self._threads = torch.get_num_threads()
        self._forwards: dict[torch.Size, Callable[[Tensor], Tensor]] = {}

    def __call__(self, features: Tensor) -> Tensor:
        """What the network computes of `features` [B, C, H, W]; see `Network.features`."""
        if features.shape not in self._forwards:
            self._forwards[features.shape] = self._forward_of(features)
        with torch_threads(self._threads):
            return self._forwards[features.shape](features)

    def _forward_of(self, features: Tensor) -> Callable[[Tensor], Tensor]:
        """The faster way for features of this shape; see the class."""
        if not (self._device.type == "cpu" and can_compile() and self._network.can_be_traced):
            return self._fused
        if multiply_accumulates(self._network, features) < WORTH_COMPILING_MACS:
            return self._fused
        return CompiledNetwork(self._network, features, arithmetic(self._device), self._threads)

    @cached_property
    def _fused(self) -> Callable[[Tensor], Tensor]:
        network = fused_copy(self._network, self._device)

        def forward(features: Tensor) -> Tensor:
            with autocast(self._device):
                return network(features)

        return forward


class Engines:
    """The engines of one network, by device: each is made when it is first asked for, and kept."""

    def __init__(self, network: Network):
        self._network = network
        self._made: dict[torch.device, Engine] = {}

    def on(self, device: torch.device) -> Engine:
        """The engine for `device`."""
        if device not in self._made:
            self._made[device] = Engine(self._network, device)
        return self._made[device]


def fused_copy(network: Network, device: torch.device) -> Network:
    """A copy of `network` on `device` that predicts alike, but for rounding.

    Normalisations are fused into the convolutions before them (in evaluation mode they are affine),
    weights have the type that is computed with, so that they are not converted for every frame, and
    rectifiers overwrite their input.
    """
    copy = deepcopy(network).to(device).eval()
    for block in list(copy.modules()):
        if isinstance(block, nn.Sequential):
            for (name, layer), (next_name, norm) in pairwise(list(block.named_children())):
                if isinstance(layer, Convolution) and isinstance(norm, nn.BatchNorm2d):
                    transposed = isinstance(layer, nn.ConvTranspose2d)
                    setattr(block, name, fuse_conv_bn_eval(layer, norm, transpose=transposed))
                    setattr(block, next_name, nn.Identity())
    for layer in copy.modules():
        if isinstance(layer, Convolution):
            layer.to(arithmetic(device))
        elif isinstance(layer, nn.ReLU):
            # In place is safe in the chains of `convolution`: nobody else reads a ReLU's input.
            layer.inplace = True
    return copy.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
