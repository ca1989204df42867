"""A trained network made ready to predict: the same function in fewer operations."""

from __future__ import annotations

from copy import deepcopy
from itertools import pairwise

import torch
from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from unwrap.network import Network, arithmetic

Convolution = nn.Conv2d | nn.ConvTranspose2d


def prepared(network: Network, device: torch.device) -> Network:
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
