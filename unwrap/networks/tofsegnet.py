"""TofSegNet of Nagiub et al. (2023): a gray image to each pixel's wrap, as classes."""

from __future__ import annotations

from typing import Self

import torch
from torch import Tensor
from torch.nn import functional

from unwrap.networks.autoencoder import GrayNetwork
from unwrap.networks.losses import IGNORED, LossWeights
from unwrap.networks.network import Prediction, Settings
from unwrap.signal import Sensed, SensorDescription, Truth


class TofSegNet(GrayNetwork):
    """Gray image to the logits of each pixel's wrap class; the last class is all beyond.

    Parameters
    ----------
    width : int
        Channels of the first ResNet stage.
    classes : int
        Wrap classes 0 .. classes - 1, each one unambiguous range wide.
    f1_hz : float
        Modulation frequency whose wraps are the classes.
    """

    def __init__(self, width: int = 64, classes: int = 5, f1_hz: float = 24e6):
        super().__init__(Settings(width=width, classes=classes, f1_hz=f1_hz), classes)

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """An untrained network."""
        return cls(settings.width, settings.classes, settings.f1_hz)

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> logits [B, classes, H, W]."""
        return super().forward(gray).float()

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Cross entropy over the pixels of known truth."""
        classes = wrap_classes(truth.distance_m, self.settings).masked_fill(~truth.known, IGNORED)
        unlikely = functional.cross_entropy(output, classes, reduction="sum")
        return unlikely / weights.total(truth.known.sum()).clamp(min=1)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """A distance within the likeliest class (`class_depth_m`), and that class's probability."""
        confidence = output.softmax(1).amax(1)
        return Prediction(class_depth_m(output, self.settings.unambiguous_m), confidence)


def wrap_classes(depth_m: Tensor, settings: Settings) -> Tensor:
    """Wrap class floor(depth / unambiguous range) of each pixel, the last one for all beyond.

    Examples
    --------
    >>> wrap_classes(torch.tensor([1.0, 7.0, 80.0]), Settings(classes=5))
    tensor([0, 1, 4])
    """
    return (depth_m / settings.unambiguous_m).long().clamp(0, settings.classes - 1)


def class_depth_m(logits: Tensor, unambiguous_m: float) -> Tensor:
    """Coarse distance [B, H, W] that wrap-class logits [B, classes, H, W] stand for, metres.

    The expectation over the classes' middles, kept within the likeliest class: the floor of eq. 8
    then gives that class, and where two classes are about as likely the distance lies at their
    boundary, so that the nearest candidate is right on either side of it.
    """
    probability = logits.float().softmax(1)
    likeliest = probability.argmax(1)
    middles = torch.arange(logits.shape[1], device=logits.device)[:, None, None] + 0.5
    expected = (probability * middles).sum(1)
    # A margin of a millionth keeps rounding from leaving the class.
    return expected.clamp(likeliest + 1e-6, likeliest + (1 - 1e-6)) * unambiguous_m
