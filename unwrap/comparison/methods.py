"""The results table: every method scored on the same frames with the same noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import torch
from torch import Tensor

from shotenv.dataset import SensedFrames
from unwrap.comparison.plan import Training
from unwrap.depth import (
    ReflectancePrior,
    calibrate,
    correct_sensed,
    unwrap_amplitude,
    unwrap_kernel_density,
)
from unwrap.networks import Unwrapper
from unwrap.signal import Sensed, SensorDescription, Shots
from unwrap.support import on_device
from unwrap.training import acquiring_threads, in_order, loader

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
            found = network.predict_sensed(sensed, sensor)
            probable = training.config.network in PROBABILITIES
            estimate = Estimate(found.distance_m, found.confidence if probable else None)
            seen[:] = [(sensed, estimate)]
        return seen[-1][1]

    def merged(rule: Any) -> Look:
        def look(sensed: Sensed, sensor: SensorDescription) -> Estimate:
            found = own(sensed, sensor)
            depth = correct_sensed(sensed, found.depth_m, sensor, merge=rule)
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
        return Estimate(correct_sensed(sensed, None, lenient).distance_m)

    def kernel_density(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        found = unwrap_kernel_density(
            sensed.require_raw(),
            sensor,
            offset_lsb=sensed.offset_lsb,
            noise_lsb=sensed.noise_lsb,
            shift_m=sensed.shift_m,
        )
        return Estimate(found.depth.distance_m)

    priors = {shots: _prior(training_frames, shots, device) for shots in FEW}

    def amplitude(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        found = unwrap_amplitude(
            sensed.require_raw(),
            sensor,
            prior=priors[sensed.require_raw().shots],
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
