"""The public face: a trained network by name or path, its predictions, and the correction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from unwrap.depth import Merge, correct
from unwrap.networks.engines import Prepared, torch_threads
from unwrap.networks.network import Network, Prediction, multiply_accumulates
from unwrap.networks.registry import NAMES
from unwrap.networks.sizes import predicted, stride_to, trained_size
from unwrap.networks.weight_files import load_weights
from unwrap.signal import GRAY_FULL_SCALE, Sensed, SensorDescription, unambiguous_range_m
from unwrap.support import mapped

__all__ = ["Merge", "Prediction", "SensorDescription", "Unwrapper", "correct", "load_unwrapper"]

SHIPPED = Path(__file__).parents[1] / "weights"
FRAMES_AT_ONCE = {"cpu": 1, "cuda": 64}
"""Frames that a network is shown at a time: one keeps a processor's caches, many fill a GPU."""


@dataclass(frozen=True)
class Unwrapper:
    """A trained network, ready to predict.

    Attributes
    ----------
    name : str
        "tofregnet", "tofsegnet", "toffusionnet", or a peer's.
    network : Network
        In evaluation mode.
    metadata : dict
        What is stored with the weights: width, frequency, size of the training frames, recipe.
    fingerprint : str
        SHA-256 of the weights; predictions may be kept under this key.
    """

    name: str
    network: Network = field(repr=False)
    metadata: dict = field(repr=False)
    fingerprint: str
    _ready: dict[torch.device, Prepared] = field(default_factory=dict, repr=False, compare=False)

    @property
    def unambiguous_m(self) -> float:
        """Unambiguous range that the network was trained for, metres."""
        return unambiguous_range_m(self.metadata["f1_hz"])

    def stride(self, height: int, width: int) -> int:
        """Every how many rows and columns of a frame the network is shown.

        k where height and width are k times those of the training frames, else 1; see
        `unwrap.networks.sizes`.
        """
        return stride_to(trained_size(self.metadata), (height, width))

    def predict(self, gray: Tensor) -> Prediction:
        """Coarse distance from gray images [B, H, W] alone: uint16 in 0..4095, or float in [0, 1].

        What the confidence means is told by the network's own `predict`. The network is shown
        every k-th row and column of images k times as high and wide as those it was trained on,
        and distance and confidence in between are interpolated; other sizes it sees as they are.

        Raises
        ------
        ValueError
            Another shape, dtype or range, NaN, or a network that needs samples too.
        """
        if self.network.needs != "gray":
            raise ValueError(f"{self.name} needs samples beside the gray image; use `look`")
        with torch_threads(1):
            sensed = Sensed(as_float(gray))
        return self.look(sensed, SensorDescription(f1_hz=self.metadata["f1_hz"]))

    @torch.inference_mode()
    def look(self, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """Distance from all that a sensor delivers.

        On a processor frames are computed one by one, so that a prediction does not depend on its
        batch; on a GPU many at once, where it may in the last bits. Frames k times as high and
        wide as the training frames are thinned as in `predict`; a network that needs samples then
        tells only the wraps of pixels with a usable signal, which are added to each pixel's own
        wrapped distance.

        Raises
        ------
        ValueError
            No samples, although the network needs them, or another modulation frequency.
        """
        if self.network.needs == "samples" and sensed.raw is None:
            raise ValueError(f"raw is None; {self.name} needs the samples of each frame")
        self.require_frequency(sensor)
        device = next(self.network.parameters()).device
        if device not in self._ready:
            self._ready[device] = Prepared(self.network, device)
        # What is around the network is small; torch's threads, once awake, stay in its way.
        with torch_threads(1):
            return self._look(sensed, sensor, device)

    def _look(self, sensed: Sensed, sensor: SensorDescription, device: torch.device) -> Prediction:
        count = FRAMES_AT_ONCE[device.type]

        def some(start: int) -> Sensed:
            return mapped(lambda tensor: tensor[start : start + count].to(device), sensed)

        parts = [self._predicted(some(start), sensor) for start in range(0, len(sensed), count)]
        return mapped(lambda tensor: tensor.to(sensed.gray.device), joined(parts))

    def require_frequency(self, sensor: SensorDescription) -> None:
        """Raise ValueError unless the network was trained for the sensor's first frequency."""
        if sensor.f1_hz != self.metadata["f1_hz"]:
            trained = f"{self.name} was trained for {self.metadata['f1_hz']:g}"
            raise ValueError(f"f1_hz is {sensor.f1_hz:g}; {trained}")

    def _predicted(self, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        stride, ready = self.stride(*sensed.gray.shape[-2:]), self._ready[sensed.gray.device]
        return predicted(self.network, sensed, sensor, stride, forward=ready)

    def macs(self, height: int, width: int) -> int:
        """Multiply-accumulate operations of one frame of `height` x `width` pixels.

        Of those pixels that the network is shown.
        """
        stride = self.stride(height, width)
        return multiply_accumulates(
            self.network, self.network.example(height // stride, width // stride)
        )


def joined(parts: Sequence[Prediction]) -> Prediction:
    """Predictions of one batch after the other."""
    if len(parts) == 1:
        return parts[0]
    return Prediction(
        torch.cat([part.distance_m for part in parts]),
        torch.cat([part.confidence for part in parts]),
    )


def as_float(gray: Tensor) -> Tensor:
    """[B, H, W] in [0, 1], float32, checked."""
    if gray.ndim != 3 or 0 in gray.shape:
        raise ValueError(f"gray has shape {tuple(gray.shape)}; expected [B, H, W], not empty")
    if gray.dtype == torch.uint16:
        gray, highest = gray.to(torch.float32) / GRAY_FULL_SCALE, "4095"
    elif gray.is_floating_point():
        gray, highest = gray.to(torch.float32), "1"
    else:
        raise ValueError(f"gray is {gray.dtype}; expected uint16 in 0..4095 or float in [0, 1]")
    low, high = gray.aminmax()
    # Written so that NaN, which compares false, is refused as well.
    if not (low >= 0 and high <= 1):
        raise ValueError(f"gray holds values outside 0..{highest}, or NaN")
    return gray


def load_unwrapper(name_or_path: str | Path) -> Unwrapper:
    """A trained network: the name of a shipped one, or the path of a safetensors file.

    Raises
    ------
    ValueError
        The file is missing, damaged or no network of this project; the message names it and the
        cure.
    """
    shipped = str(name_or_path) in NAMES
    path = SHIPPED / f"{name_or_path}.safetensors" if shipped else Path(name_or_path)
    weights = load_weights(path)
    network = weights.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return Unwrapper(weights.metadata["network"], network, weights.metadata, weights.fingerprint)
