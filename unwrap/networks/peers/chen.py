"""Clean phase and wraps from noisy samples and the gray image, after Chen et al. (2020)."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from unwrap.depth import nearest_wraps
from unwrap.networks import (
    Autoencoder,
    LossWeights,
    Prediction,
    Settings,
    class_depth_m,
    masked_mean,
    pad,
    wrap_classes,
)
from unwrap.networks.peers.planes import PLANES, sample_planes
from unwrap.signal import TWO_PI, Sensed, SensorDescription, Truth, distance_m, wrap_phase


class ChenNet(Autoencoder):
    """Samples and gray image to a noise-free phase, as its unit vector, and wrap logits.

    After Y. Chen, J. Ren, X. Cheng, K. Qian, L. Wang, J. Gu, Very Power Efficient Neural
    Time-of-Flight, WACV 2020: raw samples at low exposure, guided by the camera's passive image,
    to depth. Adapted: the guide is gray instead of colour; the depth comes as a wrap class and the
    unit vector of the phase, which is what clean samples at one frequency tell, predicted as what
    to add to the measured vector; the body is the autoencoder of this project's own networks; the
    exposure is the sensor's.
    """

    needs = "samples"

    def __init__(self, settings: Settings):
        super().__init__(settings, PLANES + 1, 2 + settings.classes)

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """`sample_planes` and the gray image, scaled to [-1, 1]: [B, 8, H, W]."""
        gray = 2.0 * sensed.gray.unsqueeze(1) - 1.0
        maps = torch.cat((sample_planes(sensed, sensor), gray), 1)
        return maps.contiguous(memory_format=torch.channels_last)

    def forward(self, maps: Tensor) -> Tensor:
        """maps [B, 8, H, W] -> cosine and sine of the phase, logits: [B, 2 + classes, H, W]."""
        height, width = maps.shape[-2:]
        output = super().forward(pad(maps))[..., :height, :width].float()
        # The first two samples over their amplitude are about its cosine and sine.
        vector = functional.normalize(maps[:, :2].float() + output[:, :2])
        return torch.cat((vector, output[:, 2:]), 1)

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """1 - cos(phase error), and cross entropy of the wrap classes, over known pixels.

        Truth that is clamped at the range has a class but no phase. The terms' `weights` belong to
        the project's own loss.
        """
        phase = truth.distance_m * (TWO_PI / self.settings.unambiguous_m)
        aligned = output[:, 0] * phase.cos() + output[:, 1] * phase.sin()
        unclamped = truth.known & (truth.distance_m < self.settings.range_m)
        classes = wrap_classes(truth.distance_m, self.settings)
        unlikely = functional.cross_entropy(output[:, 2:], classes, reduction="none")
        turned = masked_mean(1 - aligned, unclamped, weights.total)
        return turned + masked_mean(unlikely, truth.known, weights.total)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The noise-free phase's wrap candidate nearest to `class_depth_m`.

        The confidence is the likeliest class's probability.
        """
        logits, unambiguous_m = output[:, 2:], self.settings.unambiguous_m
        phase = wrap_phase(torch.atan2(output[:, 1], output[:, 0]))
        clean_m = distance_m(phase, self.settings.f1_hz)
        wraps = nearest_wraps(class_depth_m(logits, unambiguous_m), clean_m, unambiguous_m)
        return Prediction(clean_m + wraps * unambiguous_m, logits.softmax(1).amax(1))
