"""Wrap counts as segmentation of the wrapped phase, after Spoorthi, Gorthi and Gorthi (2019)."""

from __future__ import annotations

import math

from torch import Tensor, nn
from torch.nn import functional

from unwrap.networks import (
    LossWeights,
    Network,
    Prediction,
    Settings,
    convolution,
    masked_mean,
    pad,
    true_wraps,
)
from unwrap.signal import Sensed, SensorDescription, Truth, first_phase, wrapped_distance_m


class PhaseNet(Network):
    """Encoder with max pooling; decoder that puts values back where the maxima were, as SegNet's.

    After G. E. Spoorthi, S. Gorthi, R. K. S. S. Gorthi, PhaseNet: A Deep Convolutional Neural
    Network for Two-Dimensional Phase Unwrapping, IEEE Signal Processing Letters 26(1), 2019. As
    there it sees the wrapped phase alone, as an angle, and tells the wrap count of each pixel.
    Adapted: the counts are those of the sensor's range instead of a synthetic surface's, channels
    and layers are fewer, and the paper's smoothing of the counts afterwards is left out.
    """

    needs = "samples"
    can_be_traced = False  # Where it unpools to depends on the image.

    def __init__(self, settings: Settings):
        super().__init__(settings)
        width = settings.width
        channels = (max(2, width // 2), width, 2 * width, 4 * width)
        levels = [convolution(1, channels[0])]
        levels += map(_twice, channels[:-1], channels[1:])
        self.encoder = nn.ModuleList(levels)
        self.middle = _twice(channels[-1], channels[-1])
        falling = channels[::-1]
        self.decoder = nn.ModuleList(map(convolution, falling[:-1], falling[1:]))
        self.head = nn.Conv2d(channels[0], settings.classes, 3, padding=1)

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """Wrapped phase [B, 1, H, W], scaled to [-1, 1)."""
        return first_phase(sensed, sensor).phase_rad.unsqueeze(1) / math.pi - 1.0

    def forward(self, phase: Tensor) -> Tensor:
        """phase [B, 1, H, W] -> logits of the wrap counts [B, classes, H, W]."""
        height, width = phase.shape[-2:]
        features, places = pad(phase), []
        for encode in self.encoder:
            features, place = functional.max_pool2d(encode(features), 2, return_indices=True)
            places.append(place)
        features = self.middle(features)
        # The head unpools, too: there are as many levels as decoder layers and head.
        for decode in (*self.decoder, self.head):
            features = decode(functional.max_unpool2d(features, places.pop(), [2, 2]))
        return features[..., :height, :width].float()

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Cross entropy over the pixels of known truth; the terms' `weights` are our own loss's."""
        # Counted from the measured phase, as the paper's: noise next to a wrap costs no whole one.
        wrapped_m = wrapped_distance_m(sensed, sensor)
        counts = true_wraps(truth.distance_m, wrapped_m, self.settings)
        unlikely = functional.cross_entropy(output, counts, reduction="none")
        return masked_mean(unlikely, truth.known, weights.total)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """Likeliest count times the unambiguous range plus the wrapped distance.

        The confidence is that count's probability.
        """
        confidence, counts = output.softmax(1).max(1)
        wrapped_m = wrapped_distance_m(sensed, sensor)
        return Prediction(wrapped_m + counts * self.settings.unambiguous_m, confidence)


def _twice(inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(convolution(inputs, outputs), convolution(outputs, outputs))
