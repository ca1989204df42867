"""TofFusionNet: gray image, phase, amplitude and memory to the wrap of every pixel.

What comes out is a curve over distance for each pixel: scores at knots, linear in between, the
logarithm of a density. The pixel's own wrap candidates (wrapped distance plus whole unambiguous
ranges) are looked up on it, so that a decision near a wrap boundary follows the phase as measured,
noise and all; where a pixel has no usable signal the curve's mean is its distance.

The body (`unwrap.networks.autoencoder.Autoencoder`) sees the scene at half resolution. What it finds is judged at
full resolution by a small last stage, beside the phase and amplitude of each pixel and its
neighbours. That stage also gives a vector for each pixel that is added to the unit vector of its
phase: where noise is strong, the neighbours' phase outweighs the pixel's own.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import ClassVar, Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from unwrap.depth import fit_temperature, nearest_wraps
from unwrap.networks.autoencoder import IGNORED, Autoencoder, convolution, describe, pad
from unwrap.networks.losses import LossWeights
from unwrap.networks.network import Needs, Prediction, Settings, autocast
from unwrap.networks.phase_maps import phase_maps
from unwrap.signal import Memory, Sensed, SensorDescription, Shots, Truth, measured, samples_of

FEATURES = 9
"""Maps that the network sees: three of gray, four of phase, two of memory."""
HIDDEN = 16
"""Maps that the body gives to each pixel, and the hidden layers' width."""
VECTOR = 2
"""Maps of the vector that corrects the phase."""
LEAST_ALONG = 0.01
"""Least component along the measured phase; its inverse bounds the gradient."""
KNOTS_PER_WRAP = 2
COARSE_WEIGHT = 0.2
"""Weight of the loss of the whole curve beside that of the wrap candidates."""
CORRECTION_WEIGHT = 0.5
"""Weight of the mean error in metres at the right wrap, as above."""
FORGOTTEN = 0.5
"""Share of the training frames whose memory is taken away."""
DOUBTED = 0.1
"""Share of the blocks of remembered depth erased in training; as many are moved each way."""
BLOCKS = (6, 8)
"""Blocks down and across an image."""
CALIBRATION_PIXELS = 200_000
"""At most so many pixels for each number of samples."""


class TofFusionNet(Autoencoder):
    """Scores at the knots of distance and a correction, from all that the sensor delivers.

    How many samples were taken is not among the features: a batch has one number of samples, and
    batch normalisation would take the constant away in training and leave it in use.

    Parameters
    ----------
    settings : Settings
        Knots lie `KNOTS_PER_WRAP` to an unambiguous range of `f1_hz`, from 0 to the end of the last
        of `classes` wraps.
    """

    needs: ClassVar[Needs] = "samples"
    temperature: Tensor
    """Of the softmax over the candidates, with 2 and with more samples; see `calibrate`."""

    def __init__(self, settings: Settings):
        super().__init__(settings, FEATURES, HIDDEN)
        self.judge = nn.Sequential(
            convolution(HIDDEN + FEATURES, HIDDEN),
            convolution(HIDDEN, HIDDEN),
            nn.Conv2d(HIDDEN, KNOTS_PER_WRAP * settings.classes + 1 + VECTOR, 1),
        )
        self.register_buffer("temperature", torch.ones(2))

    @classmethod
    def build(cls, settings: Settings) -> Self:
        """Untrained."""
        return cls(settings)

    def forward(self, features: Tensor) -> Tensor:
        """features [B, FEATURES, H, W] -> [B, knots + VECTOR, H, W], for any H and W.

        The last maps are what is added to the cosine and sine of the phase, see `correction_rad`.
        """
        height, width = features.shape[-2:]
        padded = pad(features)
        output = self.judge(torch.cat((super().forward(padded), padded), 1))
        return output.float()[..., :height, :width]

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """Gray image, phase, amplitude, saturation, memory.

        In training memory is partly withheld and spoilt (`doubted`), so that the network does not
        come to rely on it. What happens is drawn from torch's global generator, which training is
        to seed at each step.

        Raises
        ------
        ValueError
            There are no samples.
        """
        memory = sensed.memory
        if memory is not None and self.training:
            memory = doubted(memory, self.settings.unambiguous_m)
        maps = (
            describe(sensed.gray.unsqueeze(1)),
            phase_maps(sensed, sensor),
            memory_maps(memory, sensed.gray, self.settings.range_m),
        )
        return torch.cat(maps, 1).contiguous(memory_format=torch.channels_last)

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Cross entropy of the wrap candidates, that of the knots, and the corrected mean error.

        The first and last count pixels with a usable signal, the second all of known truth, at
        `COARSE_WEIGHT`. `weights` are those of other networks.
        """
        unambiguous_m = self.settings.unambiguous_m
        wrapped_m, signal = measured(sensed, sensor)
        scores, correction_m = self.parts(output, wrapped_m)
        wraps = own_wraps(truth.distance_m, wrapped_m, self.settings)
        counted = truth.known & signal
        candidates = candidate_scores(scores, wrapped_m, unambiguous_m)
        wrap = functional.cross_entropy(
            candidates, wraps.masked_fill(~counted, IGNORED), reduction="sum"
        ) / counted.sum().clamp(min=1)
        coarse = mean_over(knot_entropy(scores, truth.distance_m, unambiguous_m), truth.known)
        error_m = wrapped_m + wraps * unambiguous_m + correction_m - truth.distance_m
        # Truth that is clamped is not the pixel's own.
        exact = counted & (truth.distance_m < self.settings.range_m)
        return wrap + COARSE_WEIGHT * coarse + CORRECTION_WEIGHT * mean_over(error_m.abs(), exact)

    def parts(self, output: Tensor, wrapped_m: Tensor) -> tuple[Tensor, Tensor]:
        """Scores [B, knots, H, W] and correction [B, H, W], metres, from what `forward` gave."""
        scores, vector = output[:, :-VECTOR], output[:, -VECTOR:]
        turn_m = self.settings.unambiguous_m / math.tau
        return scores, turn_m * correction_rad(vector, wrapped_m / turn_m)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The likeliest candidate, corrected, and the probability that its wrap is right.

        Pixels without a usable signal have the mean of their curve, and as confidence the
        probability of the candidate that lies there.
        """
        unambiguous_m = self.settings.unambiguous_m
        wrapped_m, signal = measured(sensed, sensor)
        scores, correction_m = self.parts(output, wrapped_m)
        coarse_m = mean_distance_m(scores, unambiguous_m)
        place_m = torch.where(signal, wrapped_m, coarse_m.remainder(unambiguous_m))
        logits = candidate_scores(scores, place_m, unambiguous_m)
        probability = (logits / self.temperature[_place_of(sensed)]).softmax(1)
        wraps = torch.where(signal, probability.argmax(1), (coarse_m / unambiguous_m).long())
        confidence = probability.gather(1, wraps.unsqueeze(1)).squeeze(1)
        corrected_m = wrapped_m + wraps * unambiguous_m + correction_m
        return Prediction(torch.where(signal, corrected_m.clamp(min=0), coarse_m), confidence)

    @torch.no_grad()
    def calibrate(self, batches: Iterable[tuple[Sensed, Truth]], sensor: SensorDescription) -> None:
        """Fit `temperature` on frames that the network was not trained on.

        It is the one that gives the right wraps the greatest likelihood, for 2 samples and for
        more by themselves; where there are no frames of a kind it stays as it is. Pixels without a
        usable signal and those of truth beyond the range are left out, and of the others every
        batch gives at most `CALIBRATION_PIXELS`, evenly spaced.
        """
        found: tuple[list, list] = ([], [])
        self.eval()
        for sensed, truth in batches:
            found[_place_of(sensed)].append(self._labelled(sensed, truth, sensor))
        for place, pairs in enumerate(found):
            if pairs:
                logits, wraps = (torch.cat(part) for part in zip(*pairs, strict=True))
                if len(logits):
                    self.temperature[place] = fit_temperature(logits, wraps)

    def _labelled(
        self, sensed: Sensed, truth: Truth, sensor: SensorDescription
    ) -> tuple[Tensor, Tensor]:
        """Candidate scores [N, classes] and right wraps [N] of the pixels that tell something."""
        with autocast(sensed.gray.device):
            output = self(self.features(sensed, sensor))
        wrapped_m, signal = measured(sensed, sensor)
        scores = output[:, :-VECTOR]
        logits = candidate_scores(scores, wrapped_m, self.settings.unambiguous_m)
        wraps = own_wraps(truth.distance_m, wrapped_m, self.settings)
        told = signal & truth.known & (truth.distance_m < self.settings.range_m)
        step = max(1, int(told.sum()) // CALIBRATION_PIXELS)
        return logits.movedim(1, -1)[told][::step], wraps[told][::step]


def _place_of(sensed: Sensed) -> int:
    """Which temperature is for these frames."""
    return int(samples_of(sensed).shots > Shots.TWO)


def correction_rad(vector: Tensor, phase_rad: Tensor) -> Tensor:
    """Angle [B, H, W] from the measured phase to its unit vector plus `vector` [B, 2, H, W].

    Within a right angle either way: along the measured phase the sum is kept at `LEAST_ALONG` or
    more by a softplus.
    """
    cosine, sine = phase_rad.cos(), phase_rad.sin()
    along = LEAST_ALONG + functional.softplus(1 + cosine * vector[:, 0] + sine * vector[:, 1])
    across = cosine * vector[:, 1] - sine * vector[:, 0]
    return (across / along).atan()


def candidate_scores(scores: Tensor, wrapped_m: Tensor, unambiguous_m: float) -> Tensor:
    """Curves [B, knots, H, W] looked up at the wrap candidates of `wrapped_m` [B, H, W].

    Returns [B, classes, H, W]: class n stands for the distance wrapped_m + n unambiguous_m. All
    candidates of a pixel lie equally far behind the first knot of their wrap, so that one set of
    hat functions serves them all.
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
    wraps = nearest_wraps(truth_m, wrapped_m, settings.unambiguous_m)
    return wraps.long().clamp(max=settings.classes - 1)


def knot_entropy(scores: Tensor, distance_m: Tensor, unambiguous_m: float) -> Tensor:
    """Cross entropy [B, H, W] of the softmax over the knots; a distance is shared by two knots."""
    last = scores.shape[1] - 1
    place = (distance_m * (KNOTS_PER_WRAP / unambiguous_m)).clamp(0, last)
    lower = place.long().clamp(max=last - 1).unsqueeze(1)
    ends = scores.log_softmax(1).gather(1, torch.cat((lower, lower + 1), 1))
    return -torch.lerp(ends[:, 0], ends[:, 1], place - lower.squeeze(1))


def mean_distance_m(scores: Tensor, unambiguous_m: float) -> Tensor:
    """Mean [B, H, W] of the knots' distances under their softmax, metres."""
    apart_m, knots = unambiguous_m / KNOTS_PER_WRAP, scores.shape[1]
    knots_m = torch.arange(knots).to(scores) * apart_m
    mean_m = torch.einsum("bkhw,k->bhw", scores.softmax(1), knots_m)
    # The end itself would be in a wrap beyond the last.
    return mean_m.clamp(max=(knots - 1) * apart_m * (1 - 1e-6))


def mean_over(values: Tensor, counted: Tensor) -> Tensor:
    """Mean of `values` where `counted`; 0 where nothing is."""
    return torch.where(counted, values, 0).sum() / counted.sum().clamp(min=1)


def memory_maps(memory: Memory | None, like: Tensor, range_m: float) -> Tensor:
    """Remembered distance over the range, and where there is one: [B, 2, H, W]; zeros without."""
    if memory is None:
        return torch.zeros_like(like).unsqueeze(1).repeat(1, 2, 1, 1)
    return torch.stack((memory.distance_m * (memory.known / range_m), memory.known), 1)


def doubted(memory: Memory, unambiguous_m: float) -> Memory:
    """Memory as it is shown in training: none of `FORGOTTEN` of the frames, blocks of others wrong.

    Of the blocks (`BLOCKS` to an image) a share `DOUBTED` is erased, and as large a share is moved
    by one unambiguous range each way, which is how a memory of wrong wraps looks.
    """
    batch, height, width = memory.known.shape
    device = memory.known.device
    kept = (torch.rand(batch, 1, 1, device=device) >= FORGOTTEN).float()
    fate = torch.rand(batch, 1, *BLOCKS, device=device)
    fate = functional.interpolate(fate, (height, width), mode="nearest").squeeze(1)
    known = memory.known * kept * (fate >= DOUBTED).float()
    nearer = ((fate >= DOUBTED) & (fate < 2 * DOUBTED)).float()
    farther = (fate >= 1 - DOUBTED).float()
    moved_m = memory.distance_m + unambiguous_m * (farther - nearer)
    return replace(memory, distance_m=moved_m.clamp(min=0) * known, known=known)
