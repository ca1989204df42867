"""TofFusionNet: gray image, phase, amplitude and memory to the wrap of every pixel.

For each pixel the network gives a curve over distance, the logarithm of a density: scores at
*knots*, two to an unambiguous range, linear in between. The pixel's own wrap candidates (wrapped
distance plus whole unambiguous ranges) are looked up on it, and the highest wins. So a decision
near a wrap boundary follows the phase as measured, noise and all: at a true distance of 6.3 m,
just beyond the first wrap, a pixel whose phase says 6.2 m is in wrap 0 and one that says 0.05 m in
wrap 1. Where a pixel has no valid signal the curve's mean is its distance.

The body (`unwrap.networks.autoencoder.Autoencoder`) sees the scene at half resolution. What it
finds goes at full resolution through a small last stage, together with the phase and amplitude of
each pixel and its neighbours. That stage also gives a vector for each pixel that is added to the
unit vector of its phase: where noise is strong, the neighbours' phase outweighs the pixel's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from unwrap.depth import fit_temperature, nearest_wraps
from unwrap.networks.autoencoder import Autoencoder, convolution, pad
from unwrap.networks.input_maps import gray_maps, memory_maps, phase_maps
from unwrap.networks.losses import IGNORED, LossWeights, masked_mean
from unwrap.networks.network import Draw, Needs, Prediction, Settings, autocast
from unwrap.signal import Memory, Sensed, SensorDescription, Shots, Truth, wrapped_and_valid

FEATURES = 9
"""Input maps: three of gray, four of phase, two of memory; see `unwrap.networks.input_maps`."""
HIDDEN = 16
"""Maps that the body gives to each pixel, and the hidden layers' width."""
VECTOR = 2
"""Output maps of the vector that corrects the phase: what is added to its cosine and sine."""
LEAST_ALONG = 0.01
"""Least component along the measured phase; its inverse bounds the gradient."""
KNOTS_PER_WRAP = 2
"""Knots of a curve in each unambiguous range."""
# Assumed, like all numbers down to `SPOILT`.
COARSE_WEIGHT = 0.2
"""Weight of the loss of the whole curve beside that of the wrap candidates."""
CORRECTION_WEIGHT = 0.5
"""Weight of the mean error in metres at the right wrap, beside the same loss."""
FORGOTTEN = 0.5
"""Share of the training frames that are shown no memory."""
SPOILT = 0.1
"""Share of the blocks of remembered depth that are erased in training; see `spoil_memory`."""
BLOCKS = (6, 8)
"""Blocks down and across an image."""
CALIBRATION_PIXELS = 200_000
"""Pixels that a batch gives at most to the fit of a temperature."""


class TofFusionNet(Autoencoder):
    """All that the sensor delivers to a curve over distance and a correction of the phase.

    How many samples were taken is not among the input maps: it is constant in a batch, so that
    batch normalisation would subtract it in training, and not in use.

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
        # The names of layers are those of the weight files: renaming one orphans its weights.
        self.judge = nn.Sequential(
            convolution(HIDDEN + FEATURES, HIDDEN),
            convolution(HIDDEN, HIDDEN),
            nn.Conv2d(HIDDEN, KNOTS_PER_WRAP * settings.classes + 1 + VECTOR, 1),
        )
        self.register_buffer("temperature", torch.ones(2))

    def forward(self, features: Tensor) -> Tensor:
        """features [B, FEATURES, H, W] -> [B, knots + VECTOR, H, W], for any H and W.

        The last maps are what is added to the cosine and sine of the phase, see `correction_rad`.
        """
        height, width = features.shape[-2:]
        padded = pad(features)
        output = self.judge(torch.cat((super().forward(padded), padded), 1))
        return output.float()[..., :height, :width]

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """Maps of gray image, phase, amplitude, saturation and memory.

        Raises
        ------
        ValueError
            There are no samples.
        """
        maps = (
            gray_maps(sensed.gray.unsqueeze(1)),
            phase_maps(sensed, sensor),
            memory_maps(sensed.memory, sensed.gray, self.settings.range_m),
        )
        return torch.cat(maps, 1).contiguous(memory_format=torch.channels_last)

    def as_trained_on(self, sensed: Sensed, draw: Draw) -> Sensed:
        """With memory partly withheld and spoilt, so that the network does not come to rely on it.

        See `spoil_memory`.
        """
        if sensed.memory is None:
            return sensed
        memory = spoil_memory(sensed.memory, self.settings.unambiguous_m, draw)
        return replace(sensed, memory=memory)

    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Cross entropy of the wrap candidates, that of the knots, and the mean error in metres.

        The error is that of the corrected distance in the right wrap. The first and last score
        valid pixels, the second all of known distance.
        """
        unambiguous_m = self.settings.unambiguous_m
        wrapped_m, valid = wrapped_and_valid(sensed, sensor)
        scores, correction_m = self.parts(output, wrapped_m)
        wraps = true_wraps(truth.distance_m, wrapped_m, self.settings)
        scored = truth.known & valid
        candidates = candidate_scores(scores, wrapped_m, unambiguous_m)
        # Summed and divided here: cross_entropy's own mean is NaN where no pixel is scored.
        wrap = functional.cross_entropy(
            candidates, wraps.masked_fill(~scored, IGNORED), reduction="sum"
        ) / weights.total(scored.sum()).clamp(min=1)
        unlikely = knot_entropy(scores, truth.distance_m, unambiguous_m)
        coarse = masked_mean(unlikely, truth.known, weights.total)
        error_m = wrapped_m + wraps * unambiguous_m + correction_m - truth.distance_m
        # A distance that is clamped at the range is not the pixel's own, and has no error.
        unclamped = truth.distance_m < self.settings.range_m
        fine = masked_mean(error_m.abs(), scored & unclamped, weights.total)
        return wrap + COARSE_WEIGHT * coarse + CORRECTION_WEIGHT * fine

    def parts(self, output: Tensor, wrapped_m: Tensor) -> tuple[Tensor, Tensor]:
        """Scores [B, knots, H, W] and correction [B, H, W], metres, from what `forward` gave."""
        scores, vector = output[:, :-VECTOR], output[:, -VECTOR:]
        turn_m = self.settings.unambiguous_m / math.tau
        return scores, turn_m * correction_rad(vector, wrapped_m / turn_m)

    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """The likeliest candidate, corrected, and the probability that its wrap is right.

        Pixels that are not valid have the mean of their curve, and as confidence the probability of
        the wrap that it lies in.
        """
        unambiguous_m = self.settings.unambiguous_m
        wrapped_m, valid = wrapped_and_valid(sensed, sensor)
        scores, correction_m = self.parts(output, wrapped_m)
        coarse_m = mean_distance_m(scores, unambiguous_m)
        # The curve is looked up where the pixel is taken to be: at its phase, or at the mean.
        place_m = torch.where(valid, wrapped_m, coarse_m.remainder(unambiguous_m))
        logits = candidate_scores(scores, place_m, unambiguous_m)
        probability = (logits / self.temperature[_temperature_index(sensed)]).softmax(1)
        wraps = torch.where(valid, probability.argmax(1), (coarse_m / unambiguous_m).long())
        confidence = probability.gather(1, wraps.unsqueeze(1)).squeeze(1)
        corrected_m = wrapped_m + wraps * unambiguous_m + correction_m
        return Prediction(torch.where(valid, corrected_m.clamp(min=0), coarse_m), confidence)

    @torch.no_grad()
    def calibrate(
        self,
        batches: Iterable[tuple[Sensed, Truth]],
        sensor: SensorDescription,
        pooled: Callable[[list], list] = list,
    ) -> None:
        """Fit `temperature` on frames that the network was not trained on.

        It is the one that gives the right wraps the greatest likelihood, one for 2 samples and one
        for more; where there are no frames of a kind it stays as it is. Scored are valid pixels of
        known, unclamped distance, of which every batch gives at most about `CALIBRATION_PIXELS`,
        evenly spaced.
        """
        found: tuple[list, list] = ([], [])
        self.eval()
        scored = [
            (_temperature_index(sensed), *self._scored(sensed, truth, sensor))
            for sensed, truth in batches
        ]
        for index, *pair in pooled(scored):
            found[index].append(pair)
        for index, pairs in enumerate(found):
            if pairs:
                logits, wraps = (torch.cat(part) for part in zip(*pairs, strict=True))
                if len(logits):
                    self.temperature[index] = fit_temperature(logits, wraps)

    def _scored(
        self, sensed: Sensed, truth: Truth, sensor: SensorDescription
    ) -> tuple[Tensor, Tensor]:
        """Candidate scores [N, classes] and right wraps [N] of the scored pixels."""
        with autocast(sensed.gray.device):
            output = self(self.features(sensed, sensor))
        wrapped_m, valid = wrapped_and_valid(sensed, sensor)
        scores = output[:, :-VECTOR]
        logits = candidate_scores(scores, wrapped_m, self.settings.unambiguous_m)
        wraps = true_wraps(truth.distance_m, wrapped_m, self.settings)
        scored = valid & truth.known & (truth.distance_m < self.settings.range_m)
        step = max(1, int(scored.sum()) // CALIBRATION_PIXELS)
        return logits.movedim(1, -1)[scored][::step], wraps[scored][::step]


def _temperature_index(sensed: Sensed) -> int:
    """Which temperature is for these frames: 0 with two samples, 1 with more."""
    return int(sensed.require_raw().shots > Shots.TWO)


def correction_rad(vector: Tensor, phase_rad: Tensor) -> Tensor:
    """Angle [B, H, W] from the measured phase to its unit vector plus `vector` [B, 2, H, W].

    It is within a right angle either way, since a softplus keeps the component of the sum along the
    measured phase at `LEAST_ALONG` or more.

    Examples
    --------
    A vector that points straight to the left of the phase, 0, turns it by 45 degrees where it is as
    long as the component along the phase, of whose 1 the softplus makes 1.3233.

    >>> correction_rad(torch.tensor([0.0, 1.3233]).view(1, 2, 1, 1), torch.zeros(1, 1, 1))
    tensor([[[0.7854]]])
    """
    cosine, sine = phase_rad.cos(), phase_rad.sin()
    along = LEAST_ALONG + functional.softplus(1 + cosine * vector[:, 0] + sine * vector[:, 1])
    across = cosine * vector[:, 1] - sine * vector[:, 0]
    return (across / along).atan()


def candidate_scores(scores: Tensor, wrapped_m: Tensor, unambiguous_m: float) -> Tensor:
    """Curves [B, knots, H, W] looked up at the wrap candidates of `wrapped_m` [B, H, W].

    Returns [B, classes, H, W]: class n stands for the distance wrapped_m + n unambiguous_m. All
    candidates of a pixel lie equally far behind the first knot of their wrap, so that one set of
    weights of the linear interpolation (hat functions of the knots) serves them all.
    """
    place = (wrapped_m * (KNOTS_PER_WRAP / unambiguous_m)).unsqueeze(1)
    classes = scores.shape[1] // KNOTS_PER_WRAP
    found = torch.zeros_like(scores[:, :classes])
    for knot in range(KNOTS_PER_WRAP + 1):
        hat = (1 - (place - knot).abs()).clamp(min=0)
        found = found + hat * scores[:, knot::KNOTS_PER_WRAP][:, :classes]
    return found


def true_wraps(truth_m: Tensor, wrapped_m: Tensor, settings: Settings) -> Tensor:
    """Whole wraps, int64 [B, H, W], that bring the measured wrapped distance nearest to the truth.

    Not floor(truth / unambiguous range) as `wrap_classes`: near a boundary noise carries the phase
    over it. The last class is all beyond.

    Examples
    --------
    Both pixels are at 6.3 m, just beyond the first wrap; noise has put the first before it.

    >>> true_wraps(torch.tensor([6.3, 6.3]), torch.tensor([6.2, 0.05]), Settings(f1_hz=24e6))
    tensor([0, 1])
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
    # The end of the last wrap itself would count as one wrap more.
    return mean_m.clamp(max=(knots - 1) * apart_m * (1 - 1e-6))


def spoil_memory(memory: Memory, unambiguous_m: float, draw: Draw) -> Memory:
    """Memory as it is shown in training: nothing in some frames, and faults in the others.

    A share `FORGOTTEN` of the frames has none. Of the blocks of the others (`BLOCKS` to an image) a
    share `SPOILT` is erased, one is moved nearer by an unambiguous range and one farther, which is
    how a memory of wrong wraps looks. `draw` as for `Network.as_trained_on`.
    """
    kept = (draw(1, 1) >= FORGOTTEN).float()
    # One number decides what becomes of a block, so that none has two faults: below `SPOILT` it is
    # erased, below twice that moved nearer, in the last such share moved farther.
    fate = draw(1, *BLOCKS)
    fate = functional.interpolate(fate, memory.known.shape[-2:], mode="nearest").squeeze(1)
    known = memory.known * kept * (fate >= SPOILT).float()
    nearer = ((fate >= SPOILT) & (fate < 2 * SPOILT)).float()
    farther = (fate >= 1 - SPOILT).float()
    moved_m = memory.distance_m + unambiguous_m * (farther - nearer)
    return replace(memory, distance_m=moved_m.clamp(min=0) * known, known=known)
