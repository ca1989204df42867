"""Scores of methods: each judged on the same frames with the same noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any

import torch
from torch import Tensor

from unwrap.comparison.compared_frames import ComparedFrames
from unwrap.comparison.compared_methods import CPU, Estimate, Look, Method
from unwrap.depth import expected_calibration_error, score
from unwrap.signal import Memory, Sensed, Shots, unambiguous_range_m
from unwrap.support import mapped, on_device
from unwrap.training import JUDGED_DRAW, acquiring_threads, in_order, loader

SCORED_AT_ONCE = {"cpu": 1, "cuda": 16}
"""Frames that methods look at together; what methods do is small work for a GPU."""
TRUSTED = 0.5
"""Confidence from which on a network remembers what it saw in the frame before; assumed."""
CLASSES = 5
"""Wrap classes that are told apart: the last is that of all farther wraps. At 24 MHz the first
four end at 25 m."""


@torch.inference_mode()
def score_methods(
    methods: Sequence[Method],
    frames: ComparedFrames,
    *,
    device: torch.device = CPU,
    tick: Callable[[int], object] = lambda frames: None,
) -> list[dict[str, Any]]:
    """A row for each method and number of samples: means over all frames.

    The frames come in their order, so that a method which remembers has seen the frame before.

    Parameters
    ----------
    methods : sequence of Method
    frames : ComparedFrames
    device : torch.device
        Where the networks are.
    tick : callable
        Told of the frames scored, once for each number of samples.

    Returns
    -------
    list of dict
        `method`, `shots`, `merge`, `frames`, and the mean of every score.
    """
    tallies = {
        (method, shots): _Tally(method, frames)
        for method in methods
        for shots in Shots
        if shots in method.shots
    }
    # Samples in the outer loop: each batch is acquired once for all methods that take as many.
    for shots in dict.fromkeys(shots for _, shots in tallies):
        of_shots = [tally for (_, its), tally in tallies.items() if its == shots]
        orders = in_order(frames, SCORED_AT_ONCE[device.type], (shots,), draw=JUDGED_DRAW)
        batches = loader(frames, orders, threads=acquiring_threads(device))
        for order, batch in zip(orders, batches, strict=True):
            sensed, truth = on_device(batch, device)
            scored = frames.scored(order.numbers, draw=JUDGED_DRAW).to(device) & truth.known
            # What a source remembers is for training; judged methods remember what they saw.
            alone = replace(sensed, memory=None)
            looks: dict[Look, Estimate] = {}
            for tally in of_shots:
                method = tally.method
                if method.remembers:
                    tally.add_sequence(alone, order.numbers, truth.distance_m, scored)
                    continue
                # A network looks once at a batch, however many rules merge what it sees.
                if method.look not in looks:
                    looks[method.look] = method.look(alone, frames.sensor)
                estimate = method.merged(looks[method.look], alone, frames.sensor)
                tally.add(estimate, truth.distance_m, scored)
            tick(len(sensed))
    return [
        {"method": method.label, "shots": int(shots), "merge": method.merge, **tally.means()}
        for (method, shots), tally in tallies.items()
    ]


class _Tally:
    """What one method made of the frames so far."""

    def __init__(self, method: Method, frames: ComparedFrames):
        self.method, self._frames = method, frames
        self._unambiguous_m = unambiguous_range_m(frames.sensor.f1_hz)
        self._scores: list[dict[str, float]] = []
        self._confidence: list[Tensor] = []
        self._right: list[Tensor] = []
        self._last: Estimate | None = None
        self._confusion = torch.zeros(CLASSES, CLASSES, dtype=torch.int64)

    def add_sequence(
        self, sensed: Sensed, numbers: Sequence[int], truth_m: Tensor, scored: Tensor
    ) -> None:
        """Let the method look at frames [B], each with its own depth of the one before; score."""
        for place, number in enumerate(numbers):
            one = slice(place, place + 1)
            shown = replace(mapped(itemgetter(one), sensed), memory=self._memory(number))
            self._last = self.method.look(shown, self._frames.sensor)
            self.add(self._last, truth_m[one], scored[one])

    def _memory(self, number: int) -> Memory | None:
        """What the method remembers of the frame before; nothing at the start of a clip."""
        last = self._last
        if last is None or not self._frames.follows(number):
            return None
        # Without a probability there is nothing to tell good depth from bad: all is remembered.
        trusted = torch.ones_like(last.depth_m) if last.confidence is None else last.confidence
        seen_m = last.depth_m.masked_fill(trusted < TRUSTED, torch.nan)
        # Sources keep their ego motion, and warp, on the processor.
        return on_device(self._frames.warp(seen_m.cpu(), [number]), seen_m.device)

    def add(self, estimate: Estimate, truth_m: Tensor, scored: Tensor) -> None:
        """Score an estimate of frames [B], each by itself."""
        for place in range(len(truth_m)):
            one = slice(place, place + 1)
            self._add_one(mapped(itemgetter(one), estimate), truth_m[one], scored[one])

    def _add_one(self, estimate: Estimate, truth_m: Tensor, scored: Tensor) -> None:
        """Score one frame [1, H, W]; depth that is missing counts as 0."""
        depth_m = estimate.depth_m.nan_to_num(0.0)
        range_m = self._frames.sensor.max_range_m
        half_m = self._unambiguous_m / 2
        self._scores.append(
            score(depth_m, truth_m, scored, half_m)
            | accuracy_and_precision(depth_m, truth_m, scored, range_m)
        )
        # Besides the error by its own measure: `score` calls the wrap right below half a wrap of
        # error, the paper's classes are cut at fixed distances.
        true, found = (
            (distance_m[scored] / self._unambiguous_m).long().clamp(0, CLASSES - 1)
            for distance_m in (truth_m, depth_m)
        )
        counts = torch.bincount(true * CLASSES + found, minlength=CLASSES**2)
        self._confusion += counts.view(CLASSES, CLASSES).cpu()
        if estimate.confidence is not None:
            # All scored pixels are kept for the calibration error: half the memory in 16 bits.
            self._confidence.append(estimate.confidence[scored].clamp(0, 1).half())
            self._right.append(((depth_m - truth_m).abs() < half_m)[scored])

    def means(self) -> dict[str, float]:
        """Mean of each number over the frames that have it, and what is counted over all pixels."""
        means = {"frames": float(len(self._scores))}
        for name in self._scores[0]:
            values = [one[name] for one in self._scores if not math.isnan(one[name])]
            means[name] = sum(values) / len(values) if values else math.nan
        right = self._confusion.diagonal().double()
        found = self._confusion.sum(0)
        means["class_accuracy"] = float(right.sum() / self._confusion.sum())
        means["class_precision"] = float((right / found)[found > 0].mean())
        if self._confidence:
            confidence, right = torch.cat(self._confidence), torch.cat(self._right)
            means["calibration_error"] = expected_calibration_error(confidence.float(), right)
        return means


def accuracy_and_precision(
    depth_m: Tensor, truth_m: Tensor, scored: Tensor, range_m: float
) -> dict[str, float]:
    """Ours, as the paper defines neither: 100 (1 - mean |e| / range), 100 (1 - std e / range)."""
    error = (depth_m - truth_m)[scored].double()
    if not len(error):
        return {"accuracy_percent": math.nan, "precision_percent": math.nan}
    return {
        "accuracy_percent": 100 * (1 - float(error.abs().mean()) / range_m),
        "precision_percent": 100 * (1 - float(error.std(correction=0)) / range_m),
    }
