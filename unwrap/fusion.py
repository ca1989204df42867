"""TofFusionNet: gray image, phase, amplitude and memory to the wrap of every pixel.

The body (`unwrap.nets.Autoencoder`) sees the scene at half resolution; a small last stage sees its
maps beside the features at full resolution, so that wraps can change from pixel to pixel. What
comes out is a curve over distance for each pixel: scores at knots, linear in between, the logarithm
of a density. The pixel's own wrap candidates (wrapped distance plus whole unambiguous ranges) are
looked up on it, so that a decision near a wrap boundary follows the phase as measured, noise and
all; where a pixel has no usable signal the curve's mean is its distance.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar, Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from unwrap.acquisition import Shots
from unwrap.correction import SensorDescription
from unwrap.inputs import first_phase, noise_of, phase_maps, samples_of, wrapped_distance_m
from unwrap.losses import LossWeights
from unwrap.merge import weights_of
from unwrap.nets import IGNORED, Autoencoder, convolution, describe, pad
from unwrap.network import Needs, Prediction, Settings
from unwrap.sensed import Memory, Sensed, Truth

FEATURES = 10
"""Maps that the network sees: three of gray, four of phase, the samples, two of memory."""
HIDDEN = 16
"""Maps of the body that the last stage sees, and its width."""
KNOTS_PER_WRAP = 2
COARSE_WEIGHT = 0.2
"""Weight of the loss of the whole curve beside that of the wrap candidates."""
FORGOTTEN = 0.5
"""Share of the training frames whose memory is taken away."""
DOUBTED = 0.1
"""Share of the blocks of remembered depth erased in training; as many are moved each way."""
BLOCKS = (6, 8)
"""Blocks down and across an image."""


class TofFusionNet(Autoencoder):
    """Scores of distance at the knots of each pixel, from all that the sensor delivers.

    Parameters
    ----------
    settings : Settings
        `width`, `classes` and `f1_hz` matter: knots lie `KNOTS_PER_WRAP` to an unambiguous range
        from 0 to the end of the last class.
    """

    needs: ClassVar[Needs] = "samples"
    temperature: Tensor
    """Of the softmax over the candidates, for 2 and for 4 samples; see `calibrate`."""

    def __init__(self, settings: Settings):
        super().__init__(settings, FEATURES, HIDDEN)
        self.sharpen = convolution(HIDDEN + FEATURES, HIDDEN)
        self.score = nn.Conv2d(HIDDEN, KNOTS_PER_WRAP * settings.classes + 1, 1)
        self.register_buffer("temperature", torch.ones(2))

    @classmethod
    def build(cls, settings: Settings) -> Self:
        """Untrained."""
        return cls(settings)

    def forward(self, features: Tensor) -> Tensor:
        """features [B, FEATURES, H, W] -> scores [B, knots, H, W], for any H and W."""
        height, width = features.shape[-2:]
        padded = pad(features)
        sharp = self.sharpen(torch.cat((super().forward(padded), padded), 1))
        return self.score(sharp).float()[..., :height, :width]

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """Gray image, phase, amplitude, saturation, number of samples, memory.

        In training memory is partly withheld and spoilt (`doubted`), so that the network does not
        come to rely on it; what happens is drawn from torch's global generator, which training
        seeds at each step.

        Raises
        ------
        ValueError
            There are no samples.
        """
        gray = describe(sensed.gray.unsqueeze(1))
        phase = phase_maps(sensed, sensor)
        four = torch.full_like(gray[:, :1], float(samples_of(sensed).shots >= Shots.FOUR))
        memory = sensed.memory
        if memory is None:
            remembered = torch.zeros_like(gray[:, :2])
        else:
            if self.training:
                memory = doubted(memory, self.settings.unambiguous_m)
            distance = memory.distance_m / self.settings.range_m
            remembered = torch.stack((distance * memory.known, memory.known), 1)
        features = torch.cat((gray, phase, four, remembered), 1)
        return features.contiguous(memory_format=torch.channels_last)

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Cross entropy of the wrap candidates, and of the curve's knots at `COARSE_WEIGHT`.

        The first counts pixels with a usable signal, the second all of known truth.
        """
        wrapped_m = wrapped_distance_m(sensed, sensor)
        candidates = candidate_scores(output, wrapped_m, self.settings.unambiguous_m)
        target = own_wraps(truth.distance_m, wrapped_m, self.settings)
        counted = truth.known & usable(sensed, sensor)
        wrap = functional.cross_entropy(
            candidates, target.masked_fill(~counted, IGNORED), reduction="sum"
        )
        coarse = knot_entropy(output, truth.distance_m, self.settings.unambiguous_m)
        return wrap / counted.sum().clamp(min=1) + COARSE_WEIGHT * mean_over(coarse, truth.known)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The likeliest candidate, and the probability that its wrap is right.

        Pixels without a usable signal have the mean of their curve, and as confidence the
        probability of the candidate that lies there.
        """
        unambiguous_m = self.settings.unambiguous_m
        signal = usable(sensed, sensor)
        coarse_m = mean_distance_m(output, unambiguous_m)
        measured_m = wrapped_distance_m(sensed, sensor)
        wrapped_m = torch.where(signal, measured_m, coarse_m.remainder(unambiguous_m))
        probability = self.probability(output, wrapped_m, samples_of(sensed).shots)
        below = (coarse_m / unambiguous_m).long().clamp(0, self.settings.classes - 1)
        wraps = torch.where(signal, probability.argmax(1), below)
        confidence = probability.gather(1, wraps.unsqueeze(1)).squeeze(1)
        return Prediction(wrapped_m + wraps * unambiguous_m, confidence)

    def probability(self, scores: Tensor, wrapped_m: Tensor, shots: int) -> Tensor:
        """Calibrated probability [B, classes, H, W] of each wrap candidate."""
        candidates = candidate_scores(scores, wrapped_m, self.settings.unambiguous_m)
        return (candidates / self.temperature[int(shots >= Shots.FOUR)]).softmax(1)


def candidate_scores(scores: Tensor, wrapped_m: Tensor, unambiguous_m: float) -> Tensor:
    """Curves [B, knots, H, W] looked up at the wrap candidates of `wrapped_m` [B, H, W].

    Returns [B, classes, H, W]: class n stands for the distance wrapped_m + n unambiguous_m. All
    candidates of a pixel lie equally far behind their last knot, so that one set of hat functions
    serves them all.
    """
    place = (wrapped_m * (KNOTS_PER_WRAP / unambiguous_m)).unsqueeze(1)
    classes = scores.shape[1] // KNOTS_PER_WRAP
    found = torch.zeros_like(scores[:, :classes])
    for knot in range(KNOTS_PER_WRAP + 1):
        hat = (1 - (place - knot).abs()).clamp(min=0)
        found = found + hat * scores[:, knot::KNOTS_PER_WRAP][:, :classes]
    return found


def own_wraps(truth_m: Tensor, wrapped_m: Tensor, settings: Settings) -> Tensor:
    """Whole wraps, int64 [B, H, W], that bring each pixel's own wrapped distance nearest to truth.

    Not floor(truth / unambiguous range): near a boundary noise carries the phase over it.
    """
    wraps = ((truth_m - wrapped_m) / settings.unambiguous_m).round()
    return wraps.long().clamp(0, settings.classes - 1)


def knot_entropy(scores: Tensor, distance_m: Tensor, unambiguous_m: float) -> Tensor:
    """Cross entropy [B, H, W] of the softmax over the knots, the truth shared between two knots."""
    place = (distance_m * (KNOTS_PER_WRAP / unambiguous_m)).clamp(0, scores.shape[1] - 1.001)
    lower = place.long().unsqueeze(1)
    logarithms = scores.log_softmax(1)
    ends = logarithms.gather(1, torch.cat((lower, lower + 1), 1))
    return -torch.lerp(ends[:, 0], ends[:, 1], place - lower.squeeze(1))


def mean_distance_m(scores: Tensor, unambiguous_m: float) -> Tensor:
    """Mean [B, H, W] of the knots' distances under their softmax, metres."""
    knots_m = torch.arange(scores.shape[1], device=scores.device) * (unambiguous_m / KNOTS_PER_WRAP)
    return torch.einsum("bkhw,k->bhw", scores.softmax(1), knots_m.to(scores.dtype))


def mean_over(values: Tensor, counted: Tensor) -> Tensor:
    """Mean of `values` where `counted`; 0 where nothing is."""
    return (values * counted).sum() / counted.sum().clamp(min=1)


def usable(sensed: Sensed, sensor: SensorDescription) -> Tensor:
    """Pixels bool [B, H, W] with signal enough and not saturated, as `unwrap.correction` has it."""
    strong = first_phase(sensed, sensor).amplitude >= noise_of(sensed, sensor) * sensor.min_snr
    return strong & ~samples_of(sensed).saturated


def doubted(memory: Memory, unambiguous_m: float) -> Memory:
    """Memory as it is shown in training: none of `FORGOTTEN` of the frames, blocks of others wrong.

    Of the blocks (`BLOCKS` to an image) a share `DOUBTED` is erased, and as large a share is moved
    by one unambiguous range each way, which is how a memory of wrong wraps looks.
    """
    batch, height, width = memory.known.shape
    device = memory.known.device
    kept = weights_of(torch.rand(batch, 1, 1, device=device) >= FORGOTTEN)
    fate = torch.rand(batch, 1, *BLOCKS, device=device)
    fate = functional.interpolate(fate, (height, width), mode="nearest").squeeze(1)
    known = memory.known * kept * weights_of(fate >= DOUBTED)
    nearer, farther = weights_of(fate < 2 * DOUBTED), weights_of(fate >= 1 - DOUBTED)
    moved_m = memory.distance_m + unambiguous_m * (farther - nearer)
    return replace(memory, distance_m=moved_m.clamp(min=0) * known, known=known)
