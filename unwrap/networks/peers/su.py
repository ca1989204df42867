"""Raw samples to depth end to end, after Su, Heide, Wetzstein and Heidrich (2018)."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from unwrap.networks import (
    BasicBlock,
    LossWeights,
    Network,
    Prediction,
    Settings,
    convolution,
    doubling,
    masked_mean,
    own,
    pad,
)
from unwrap.networks.peers.planes import PLANES, sample_planes, with_agreement
from unwrap.signal import Sensed, SensorDescription, Truth

RESIDUAL_BLOCKS = 4
SMOOTHNESS = 0.1
"""Weight of the smoothness term; assumed."""


class SuNet(Network):
    """Encoder, residual blocks at a sixteenth of the resolution, decoder; skips are added.

    After S. Su, F. Heide, G. Wetzstein, W. Heidrich, Deep End-to-End Time-of-Flight Imaging, CVPR
    2018: raw correlations in, depth out, with an L1 loss and a smoothness term on the gradient of
    the depth. Adapted: two or four samples of one frequency instead of samples of two, divided by
    their amplitude (`sample_planes`); fewer channels. The adversarial loss is left out: it needs a
    second network and a balance between the two, and serves the look of the map rather than its
    error.
    """

    needs = "samples"
    uses_classes = False

    def __init__(self, settings: Settings):
        super().__init__(settings)
        width = settings.width
        channels = (width, 2 * width, 4 * width, 4 * width)
        self.stem = convolution(PLANES, width, stride=2)
        self.down = nn.ModuleList(
            convolution(inputs, outputs, stride=2) for inputs, outputs in pairwise(channels)
        )
        blocks = (BasicBlock(channels[-1], channels[-1]) for _ in range(RESIDUAL_BLOCKS))
        self.residual = nn.Sequential(*blocks)
        rising = channels[::-1]
        self.up = nn.ModuleList(map(doubling, rising[:-1], rising[1:]))
        self.plain = nn.ModuleList(map(convolution, rising[1:], rising[1:]))
        # The last doubling rearranges channels into 2 x 2 pixels.
        self.head = nn.Conv2d(width, 4, 1)

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """See `sample_planes`."""
        return sample_planes(sensed, sensor)

    def forward(self, planes: Tensor) -> Tensor:
        """planes [B, 7, H, W] -> distance [B, H, W], metres, in (0, range_m)."""
        height, width = planes.shape[-2:]
        skips = [self.stem(pad(planes))]
        for down in self.down:
            skips.append(down(skips[-1]))
        features = self.residual(skips.pop())
        for up, plain in zip(self.up, self.plain, strict=True):
            features = plain(up(features) + skips.pop())
        output = functional.pixel_shuffle(self.head(features), 2)[:, 0, :height, :width]
        return torch.sigmoid(output.float()) * self.settings.range_m

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """L1 over `range_m` and the smoothness term; the terms' `weights` are of our own loss."""
        prediction, target = (
            output / self.settings.range_m,
            truth.distance_m / self.settings.range_m,
        )
        error = masked_mean((prediction - target).abs(), truth.known, weights.total)
        return error + SMOOTHNESS * smoothness(prediction, target, truth.known, weights.total)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The distance; for its confidence see `with_agreement`."""
        return with_agreement(output, sensed, sensor)


def smoothness(prediction: Tensor, target: Tensor, known: Tensor, total: Callable = own) -> Tensor:
    """Total variation of the prediction, damped by exp(-|step of the target|) at true edges.

    Depths in units of the range; pairs with an unknown pixel do not count. `total` as for
    `masked_mean`.
    """
    variation = prediction.new_zeros(())
    for axis in (-2, -1):
        step, true_step = prediction.diff(dim=axis).abs(), target.diff(dim=axis).abs()
        size = known.shape[axis] - 1
        both = known.narrow(axis, 0, size) & known.narrow(axis, 1, size)
        variation = variation + masked_mean(step * torch.exp(-true_step), both, total)
    return variation
