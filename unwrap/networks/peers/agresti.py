"""A light coarse-fine network that corrects ToF distances, after Agresti et al. (2018, 2019)."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from unwrap.networks import (
    LossWeights,
    Network,
    Prediction,
    Settings,
    convolution,
    log_snr,
    masked_mean,
    pad,
)
from unwrap.networks.peers.planes import with_agreement
from unwrap.signal import (
    Sensed,
    SensorDescription,
    Truth,
    distance_m,
    first_phase,
    sample_noise_lsb,
)


class AgrestiNet(Network):
    """Two branches of few layers: one pools twice and sees far, one keeps the resolution.

    After G. Agresti, P. Zanuttigh, Deep Learning for Multi-Path Error Removal in ToF Sensors, ECCV
    Workshops 2018, and G. Agresti, H. Schaefer, P. Sartor, P. Zanuttigh, Unsupervised Domain
    Adaptation for ToF Data Denoising with Adversarial Learning, CVPR 2019. As there the network
    predicts the error of the distance, which is subtracted. Adapted: one frequency gives the
    wrapped distance and its amplitude, where theirs gave the ratios and differences of several;
    the error therefore holds the missing wraps; normalised layers; the fine branch has half the
    channels, so that the compute stays that of the other networks. Their adversarial adaptation to
    real recordings and the bilateral filter at the end are left out.
    """

    needs = "samples"
    uses_classes = False

    def __init__(self, settings: Settings):
        super().__init__(settings)
        coarse, fine = settings.width, max(2, settings.width // 2)
        self.coarse = nn.Sequential(
            convolution(2, fine),
            nn.MaxPool2d(2),
            convolution(fine, coarse),
            nn.MaxPool2d(2),
            *(convolution(coarse, coarse) for _ in range(3)),
        )
        self.fine = nn.Sequential(
            convolution(2, fine), *(convolution(fine, fine) for _ in range(3))
        )
        self.head = nn.Conv2d(coarse + fine, 1, 3, padding=1)

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """Wrapped distance over the unambiguous range, and compressed amplitude: [B, 2, H, W]."""
        frame = first_phase(sensed, sensor)
        wrapped = distance_m(frame.phase_rad, sensor.f1_hz) / self.settings.unambiguous_m
        amplitude = log_snr(frame.amplitude / sample_noise_lsb(sensed, sensor))
        return torch.stack((wrapped, amplitude), 1).contiguous(memory_format=torch.channels_last)

    def forward(self, maps: Tensor) -> Tensor:
        """maps [B, 2, H, W] -> distance [B, H, W], metres: the wrapped one minus its error."""
        height, width = maps.shape[-2:]
        padded = pad(maps)
        fine = self.fine(padded)
        size = fine.shape[-2:]
        # Pooled pixels are blocks of 4 x 4 from the corner on; torch's default (corners not
        # aligned) puts their centres there.
        coarse = functional.interpolate(self.coarse(padded), size, mode="bilinear")
        error = self.head(torch.cat((coarse, fine), 1))[:, 0, :height, :width].float()
        wrapped_m = maps[:, 0] * self.settings.unambiguous_m
        return wrapped_m - error * self.settings.range_m

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Mean |error| over `range_m`; the terms' `weights` belong to the project's own loss."""
        error_m = (output - truth.distance_m).abs()
        return masked_mean(error_m, truth.known, weights.total) / self.settings.range_m

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The distance, in 0..range_m; its confidence: see `with_agreement`."""
        return with_agreement(output.clamp(0.0, self.settings.range_m), sensed, sensor)
