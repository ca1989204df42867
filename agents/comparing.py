"""The results table: every method scored on the same frames with the same noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from typing import Any

import torch
from torch import Tensor

from agents.comparison import Training
from shotenv.sensed import SensedFrames
from unwrap.acquisition import Shots
from unwrap.correction import SensorDescription
from unwrap.data import acquiring_threads, in_order, loader, on_device
from unwrap.evaluate import score
from unwrap.inputs import samples_of
from unwrap.peers.amplitude import unwrap_amplitude
from unwrap.peers.kernel_density import unwrap_kernel_density
from unwrap.peers.reflectance import ReflectancePrior, calibrate
from unwrap.phase import unambiguous_range_m
from unwrap.reliability import expected_calibration_error
from unwrap.sensed import Memory, Sensed, mapped, moved, unwrapped
from unwrap.train import JUDGED_DRAW
from unwrap.unwrapper import Unwrapper

FEW = (Shots.TWO, Shots.FOUR)
TRUSTED = 0.5
"""Confidence from which on a network remembers what it saw in the frame before."""
CALIBRATION_DRAW = 1
"""Draw of the training frames that the reflectance prior is measured on."""
CALIBRATION_BATCH = 16
CPU = torch.device("cpu")
SCORED_AT_ONCE = {"cpu": 1, "cuda": 16}
"""Frames that methods look at together; what methods do is small work for a GPU."""


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

    seen: list[tuple[Sensed, Estimate]] = []

    def own(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        # The rules of merging ask for the same frames one after the other.
        if not (seen and seen[-1][0] is sensed):
            found = network.look(sensed, sensor)
            probable = training.config.network in PROBABILITIES
            estimate = Estimate(found.distance_m, found.confidence if probable else None)
            seen[:] = [(sensed, estimate)]
        return seen[-1][1]

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


def classical_methods(
    training_frames: SensedFrames, *, device: torch.device = CPU
) -> Iterator[Method]:
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

    priors = {shots: _prior(training_frames, shots, device) for shots in FEW}

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


def _prior(frames: SensedFrames, shots: Shots, device: torch.device) -> ReflectancePrior:
    orders = in_order(frames, CALIBRATION_BATCH, (shots,), draw=CALIBRATION_DRAW)
    batches = loader(frames, orders, threads=acquiring_threads(device))
    return calibrate((on_device(batch, device) for batch in batches), frames.sensor)


@torch.inference_mode()
def rows_of(
    methods: Sequence[Method],
    frames: SensedFrames,
    *,
    device: torch.device = CPU,
    tick: Callable[[int], object] = lambda frames: None,
) -> list[dict[str, Any]]:
    """A row for each method and number of samples: means over all frames.

    The frames come in their order, so that a method which remembers has seen the frame before.
    `device` is where the networks are; `tick` is told of the frames scored, once for each number
    of samples.
    """
    tallies = {
        (method, shots): _Tally(method, frames)
        for method in methods
        for shots in Shots
        if shots in method.shots
    }
    for shots in dict.fromkeys(shots for _, shots in tallies):
        of_shots = [tally for (_, its), tally in tallies.items() if its == shots]
        orders = in_order(frames, SCORED_AT_ONCE[device.type], (shots,), draw=JUDGED_DRAW)
        batches = loader(frames, orders, threads=acquiring_threads(device))
        for order, batch in zip(orders, batches, strict=True):
            sensed, truth = on_device(batch, device)
            scored = frames.scored(order.numbers, draw=JUDGED_DRAW).to(device) & truth.known
            for tally in of_shots:
                tally.judge(sensed, order.numbers, truth.distance_m, scored)
            tick(len(sensed))
    return [
        {"method": method.label, "shots": int(shots), "merge": method.merge, **tally.means()}
        for (method, shots), tally in tallies.items()
    ]


class _Tally:
    """What one method made of the frames so far."""

    def __init__(self, method: Method, frames: SensedFrames):
        self._method, self._frames = method, frames
        self._unambiguous_m = unambiguous_range_m(frames.sensor.f1_hz)
        self._scores: list[dict[str, float]] = []
        self._confidence: list[Tensor] = []
        self._right: list[Tensor] = []
        self._last: Estimate | None = None
        self._confusion = torch.zeros(CLASSES, CLASSES, dtype=torch.int64)

    def judge(
        self, sensed: Sensed, numbers: Sequence[int], truth_m: Tensor, scored: Tensor
    ) -> None:
        """Let the method look at frames [B], all at once unless it remembers, and score them."""
        places = [slice(place, place + 1) for place in range(len(numbers))]
        if self._method.remembers:
            for place, number in zip(places, numbers, strict=True):
                shown = replace(mapped(itemgetter(place), sensed), memory=self._memory(number))
                self._last = self._method.look(shown, self._frames.sensor)
                self._add(self._last, truth_m[place], scored[place])
            return
        shown = sensed if sensed.memory is None else replace(sensed, memory=None)
        estimate = self._method.look(shown, self._frames.sensor)
        for place in places:
            self._add(mapped(itemgetter(place), estimate), truth_m[place], scored[place])

    def _memory(self, number: int) -> Memory | None:
        """What the method remembers of the frame before; nothing at the start of a clip."""
        last = self._last
        if last is None or not self._frames.follows(number):
            return None
        trusted = torch.ones_like(last.depth_m) if last.confidence is None else last.confidence
        seen_m = last.depth_m.masked_fill(trusted < TRUSTED, torch.nan)
        return moved(self._frames.moved(seen_m.cpu(), [number]), seen_m.device)

    def _add(self, estimate: Estimate, truth_m: Tensor, scored: Tensor) -> None:
        """Score one frame [1, H, W]; depth that is missing counts as 0."""
        depth_m = estimate.depth_m.nan_to_num(0.0)
        range_m = self._frames.sensor.max_range_m
        half_m = self._unambiguous_m / 2
        self._scores.append(
            score(depth_m, truth_m, scored, half_m)
            | accuracy_and_precision(depth_m, truth_m, scored, range_m)
        )
        true, found = (self._classes(map_m[scored]) for map_m in (truth_m, depth_m))
        counts = torch.bincount(true * CLASSES + found, minlength=CLASSES**2)
        self._confusion += counts.view(CLASSES, CLASSES).cpu()
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
