"""The results table: every method scored on the same frames with the same noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from agents.comparison import Training
from shotenv.sensed import SensedFrames
from unwrap.acquisition import Shots
from unwrap.correction import SensorDescription
from unwrap.data import in_order, loader
from unwrap.evaluate import score
from unwrap.inputs import samples_of
from unwrap.peers.amplitude import unwrap_amplitude
from unwrap.peers.kernel_density import unwrap_kernel_density
from unwrap.peers.reflectance import ReflectancePrior, calibrate
from unwrap.phase import unambiguous_range_m
from unwrap.reliability import expected_calibration_error
from unwrap.sensed import Memory, Sensed, unwrapped
from unwrap.train import JUDGED_DRAW
from unwrap.unwrapper import Unwrapper

FEW = (Shots.TWO, Shots.FOUR)
TRUSTED = 0.5
"""Confidence from which on a network remembers what it saw in the frame before."""
CALIBRATION_DRAW = 1
"""Draw of the training frames that the reflectance prior is measured on."""
CALIBRATION_BATCH = 16


@dataclass(frozen=True)
class Estimate:
    """Depth [B, H, W] that a method delivers, metres, and its confidence if it is a probability."""

    depth_m: Tensor
    confidence: Tensor | None = None


Look = Callable[[Sensed, SensorDescription], Estimate]


@dataclass(frozen=True)
class Method:
    """A way from samples to depth, as rows of the table name it.

    Attributes
    ----------
    label : str
    merge : str
        "none": the method's own distance; "floor", "nearest": merged with the wrapped map.
    shots : sequence of Shots
        What it is judged with.
    look : callable
        Gives the `Estimate` of a batch of frames.
    remembers : bool
        Whether it is given its own depth of the frame before.
    """

    label: str
    merge: str
    shots: Sequence[Shots]
    look: Look
    remembers: bool = False


def methods_of(training: Training, network: Unwrapper) -> Iterator[Method]:
    """A trained network's own distance, and merged with the wrapped map where it is coarse."""

    def own(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        found = network.look(sensed, sensor)
        probable = training.config.network in PROBABILITIES
        return Estimate(found.distance_m, found.confidence if probable else None)

    def merged(rule: Any) -> Look:
        def look(sensed: Sensed, sensor: SensorDescription) -> Estimate:
            found = own(sensed, sensor)
            depth = unwrapped(sensed, found.depth_m, sensor, merge=rule)
            return replace(found, depth_m=depth.distance_m)

        return look

    yield Method(training.label, "none", FEW, own)
    if network.network.needs == "gray":
        yield from (
            Method(training.label, rule, FEW, merged(rule)) for rule in ("floor", "nearest")
        )
    if training.config.memory:
        yield Method(f"{training.label}, with memory", "none", FEW, own, remembers=True)


PROBABILITIES = ("tofsegnet", "toffusionnet", "phasenet", "chen_net")
"""Networks whose confidence is the probability that the wrap is right."""


def classical_methods(training_frames: SensedFrames) -> Iterator[Method]:
    """What needs no network; the reflectance prior is measured on frames of the training split."""

    def eight(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        # The candidate stands, however far the frequencies disagree and however weak the signal.
        lenient = replace(sensor, max_residual_m=math.inf, min_snr=0.0)
        return Estimate(unwrapped(sensed, None, lenient).distance_m)

    def kernel_density(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        found = unwrap_kernel_density(
            samples_of(sensed),
            sensor,
            offset_lsb=sensed.offset_lsb,
            noise_lsb=sensed.noise_lsb,
            shift_m=sensed.shift_m,
        )
        return Estimate(found.depth.distance_m)

    priors = {shots: _prior(training_frames, shots) for shots in FEW}

    def amplitude(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        found = unwrap_amplitude(
            samples_of(sensed),
            sensor,
            prior=priors[samples_of(sensed).shots],
            offset_lsb=sensed.offset_lsb,
            noise_lsb=sensed.noise_lsb,
            shift_m=sensed.shift_m,
        )
        return Estimate(found.depth.distance_m)

    yield Method("two frequencies, nearest candidate", "none", (Shots.EIGHT,), eight)
    yield Method(
        "kernel density (Järemo-Lawin et al. 2016)", "none", (Shots.EIGHT,), kernel_density
    )
    yield Method("amplitude (Crabb and Manduchi 2014)", "none", FEW, amplitude)


def _prior(frames: SensedFrames, shots: Shots) -> ReflectancePrior:
    orders = in_order(frames, CALIBRATION_BATCH, (shots,), draw=CALIBRATION_DRAW)
    return calibrate(loader(frames, orders), frames.sensor)


@torch.inference_mode()
def rows_of(
    methods: Sequence[Method],
    frames: SensedFrames,
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> list[dict[str, Any]]:
    """A row for each method and number of samples: means over all frames.

    Frames come one by one in their order, so that a method which remembers has seen the frame
    before.
    """
    tallies = {
        (method, shots): _Tally(frames)
        for method in methods
        for shots in Shots
        if shots in method.shots
    }
    for number in range(len(frames)):
        scored = frames.scored([number], draw=JUDGED_DRAW)
        for shots in dict.fromkeys(shots for _, shots in tallies):
            sensed, truth = frames.batch([number], draw=JUDGED_DRAW, shots=shots)
            for (method, its_shots), tally in tallies.items():
                if its_shots == shots:
                    shown = replace(sensed, memory=tally.memory(method, number))
                    estimate = method.look(shown, frames.sensor)
                    tally.add(estimate, truth.distance_m, scored & truth.known)
        tick(1)
    return [
        {"method": method.label, "shots": int(shots), "merge": method.merge, **tally.means()}
        for (method, shots), tally in tallies.items()
    ]


class _Tally:
    """What one method made of the frames so far."""

    def __init__(self, frames: SensedFrames):
        self._frames = frames
        self._unambiguous_m = unambiguous_range_m(frames.sensor.f1_hz)
        self._scores: list[dict[str, float]] = []
        self._confidence: list[Tensor] = []
        self._right: list[Tensor] = []
        self._last: Estimate | None = None
        self._confusion = torch.zeros(CLASSES, CLASSES, dtype=torch.int64)

    def memory(self, method: Method, number: int) -> Memory | None:
        """What the method remembers of the frame before; nothing at the start of a clip."""
        last = self._last
        if not method.remembers or last is None or not self._frames.follows(number):
            return None
        trusted = torch.ones_like(last.depth_m) if last.confidence is None else last.confidence
        seen_m = last.depth_m.masked_fill(trusted < TRUSTED, torch.nan)
        return self._frames.moved(seen_m, [number])

    def add(self, estimate: Estimate, truth_m: Tensor, scored: Tensor) -> None:
        """Score one frame; depth that is missing counts as 0."""
        self._last = estimate
        depth_m = estimate.depth_m.nan_to_num(0.0)
        range_m = self._frames.sensor.max_range_m
        half_m = self._unambiguous_m / 2
        self._scores.append(
            score(depth_m, truth_m, scored, half_m)
            | accuracy_and_precision(depth_m, truth_m, scored, range_m)
        )
        true, found = (self._classes(map_m[scored]) for map_m in (truth_m, depth_m))
        counts = torch.bincount(true * CLASSES + found, minlength=CLASSES**2)
        self._confusion += counts.view(CLASSES, CLASSES)
        if estimate.confidence is not None:
            self._confidence.append(estimate.confidence[scored].clamp(0, 1).half())
            self._right.append(((depth_m - truth_m).abs() < half_m)[scored])

    def _classes(self, distance_m: Tensor) -> Tensor:
        return (distance_m / self._unambiguous_m).long().clamp(0, CLASSES - 1)

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


CLASSES = 5
"""Wrap classes up to 25 m, and all beyond."""


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
