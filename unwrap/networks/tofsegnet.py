"""TODO."""

from __future__ import annotations

from typing import Self

from torch import Tensor
from torch.nn import functional

from unwrap.networks.autoencoder import (
    IGNORED,
    GrayNetwork,
    class_depth_m,
    wrap_classes,
)
from unwrap.networks.losses import LossWeights
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
    def build(cls, settings: Settings) -> Self:
        """Untrained."""
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
        classes = wrap_classes(truth.distance_m, self.settings)
        return functional.cross_entropy(output, classes.masked_fill(~truth.known, IGNORED))

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """A distance within the likeliest class (`class_depth_m`), and that class's probability."""
        confidence = output.softmax(1).amax(1)
        return Prediction(class_depth_m(output, self.settings.unambiguous_m), confidence)
