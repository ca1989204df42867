"""Every way from samples to depth that the results table compares, behind one interface."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from unwrap.comparison.catalogue import AMPLITUDE, KERNEL_DENSITY, TWO_FREQUENCIES
from unwrap.comparison.compared_frames import ComparedFrames
from unwrap.comparison.table_trainings import Training
from unwrap.depth import (
    Merge,
    ReflectancePrior,
    calibrate,
    correct_sensed,
    unwrap_amplitude,
    unwrap_kernel_density,
)
from unwrap.networks import NetworkName, Unwrapper
from unwrap.signal import Sensed, SensorDescription, Shots
from unwrap.support import on_device
from unwrap.training import acquiring_threads, in_order, loader

FEW = (Shots.TWO, Shots.FOUR)
PROBABILITIES: tuple[NetworkName, ...] = ("tofsegnet", "toffusionnet", "phasenet", "chen_net")
"""Networks whose confidence is the probability that the wrap is right; that of the others measures
how far a distance is from a boundary or from the measured phase."""
CALIBRATION_DRAW = 1
"""Draw of the training frames that the reflectance prior is measured on, that of epoch 1."""
CALIBRATION_BATCH = 16
CPU = torch.device("cpu")


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
    merge : "none", "floor" or "nearest"
        "none": the method's own distance; else how that is merged with the wrapped map.
    shots : sequence of Shots
        What it is judged with.
    look : callable
        Gives the `Estimate` of a batch of frames before it is merged. Methods with the same `look`
        share what it gives.
    remembers : bool
        Whether it is given its own depth of the frame before.
    """

    label: str
    merge: Merge
    shots: Sequence[Shots]
    look: Look
    remembers: bool = False

    def merged(self, own: Estimate, sensed: Sensed, sensor: SensorDescription) -> Estimate:
        """What the method delivers where `look` gave `own`."""
        # Left alone: of eight samples `correct_sensed` would make the frequencies' own.
        if self.merge == "none":
            return own
        depth = correct_sensed(sensed, own.depth_m, sensor, merge=self.merge)
        return replace(own, depth_m=depth.distance_m)


def network_methods(training: Training, network: Unwrapper) -> Iterator[Method]:
    """A trained network's own distance, and merged with the wrapped map where it is coarse."""
    probable = training.config.network in PROBABILITIES

    def look(sensed: Sensed, sensor: SensorDescription) -> Estimate:
        found = network.predict_sensed(sensed, sensor)
        return Estimate(found.distance_m, found.confidence if probable else None)

    label = training.label
    yield Method(label, "none", FEW, look)
    if network.network.needs == "gray":
        yield Method(label, "floor", FEW, look)
        yield Method(label, "nearest", FEW, look)
    if training.config.memory:
        yield Method(f"{label}, with memory", "none", FEW, look, remembers=True)


def classical_methods(
    training_frames: ComparedFrames, *, device: torch.device = CPU
) -> Iterator[Method]:
    """What needs no network; the reflectance prior is measured on frames of the training split."""

    def two_frequencies(sensed: Sensed, sensor: SensorDescription) -> Estimate:
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

    # Before any method is judged: a prior takes a pass over the training frames.
    priors = {shots: _reflectance_prior(training_frames, shots, device) for shots in FEW}

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

    yield Method(TWO_FREQUENCIES.label, "none", (Shots.EIGHT,), two_frequencies)
    yield Method(KERNEL_DENSITY.label, "none", (Shots.EIGHT,), kernel_density)
    yield Method(AMPLITUDE.label, "none", FEW, amplitude)


def _reflectance_prior(
    frames: ComparedFrames, shots: Shots, device: torch.device
) -> ReflectancePrior:
    orders = in_order(frames, CALIBRATION_BATCH, (shots,), draw=CALIBRATION_DRAW)
    batches = loader(frames, orders, threads=acquiring_threads(device))
    return calibrate((on_device(batch, device) for batch in batches), frames.sensor)
