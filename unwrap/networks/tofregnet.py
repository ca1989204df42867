"""TofRegNet of Nagiub et al. (2023): a gray image to coarse distance, by regression."""

from __future__ import annotations

from typing import Self

import torch
from torch import Tensor

from unwrap.networks.autoencoder import GrayNetwork
from unwrap.networks.losses import LossWeights, regression_loss, wrap_loss
from unwrap.networks.network import Prediction, Settings
from unwrap.signal import Sensed, SensorDescription, Truth


class TofRegNet(GrayNetwork):
    """Gray image to coarse depth in metres.

    Parameters
    ----------
    width : int
        Channels of the first ResNet stage.
    range_m : float
        Depths lie between 0 and this, metres.
    f1_hz : float
        Modulation frequency whose wraps are told apart.
    """

    uses_classes = False

    def __init__(self, width: int = 64, range_m: float = 30.0, f1_hz: float = 24e6):
        super().__init__(Settings(width=width, range_m=range_m, f1_hz=f1_hz), 1)

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """An untrained network."""
        return cls(settings.width, settings.range_m, settings.f1_hz)

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> depth [B, H, W], metres, in (0, range_m)."""
        # In float32: bfloat16 has steps of 0.004 below 1, which are 0.12 m of 30.
        return torch.sigmoid(super().forward(gray)[:, 0].float()) * self.settings.range_m

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Eq. 7 and our wrap loss; pixels of unknown distance count as predicted rightly."""
        truth_m = torch.where(truth.known, truth.distance_m, output.detach())
        paper = regression_loss(
            output,
            truth.distance_m,
            range_m=self.settings.range_m,
            mean_share=weights.mean_share,
            known=truth.known,
        )
        ours = wrap_loss(output, truth_m, self.settings.unambiguous_m)
        # Both are means over the images, which are of one size.
        part = len(output) / weights.total(len(output))
        return part * (weights.equation_7 * paper + weights.wrap * ours)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The distance; its confidence is how far it lies from a wrap boundary.

        0 on a boundary, 1 halfway between two: there an error changes the wrap least easily.
        """
        cycles = output / self.settings.unambiguous_m
        return Prediction(output, cycles.sub_(cycles.round()).abs_().mul_(2))
