"""A trained network by name or path, and its predictions."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import torch
from torch import Tensor

from unwrap.networks.engines import Engines
from unwrap.networks.network import Network, Prediction, multiply_accumulates
from unwrap.networks.registry import PLACES
from unwrap.networks.sizes import predict_thinned, stride_to, trained_size
from unwrap.networks.weight_files import WeightsLabel, load_weights, read_label
from unwrap.signal import GRAY_FULL_SCALE, Sensed, SensorDescription, unambiguous_range_m
from unwrap.support import concatenate, mapped, require_path, torch_threads

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

    Examples
    --------
    >>> unwrapper = load_unwrapper("tofregnet")
    >>> unwrapper.predict(torch.rand(2, 120, 160)).distance_m.shape
    torch.Size([2, 120, 160])
    """

    name: str
    network: Network = field(repr=False)
    metadata: dict = field(repr=False)
    fingerprint: str

    @cached_property
    def engines(self) -> Engines:
        """What computes the predictions; part of what is done with a network, not of what it is."""
        return Engines(self.network)

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
            raise ValueError(f"{self.name} needs samples, too; use `predict_sensed`")
        with torch_threads(1):  # As in `predict_sensed`.
            sensed = Sensed(gray_to_float(gray))
        return self.predict_sensed(sensed, SensorDescription(f1_hz=self.metadata["f1_hz"]))

    @torch.inference_mode()
    def predict_sensed(self, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """Distance from all that a sensor delivers.

        On a processor frames are computed one by one, so that a prediction does not depend on its
        batch; on a GPU many at once, where it may in the last bits. Frames k times as high and
        wide as the training frames are thinned as in `predict`; a network that needs samples then
        tells only the wraps of valid pixels, which are added to each pixel's own wrapped distance.

        Raises
        ------
        ValueError
            No samples, although the network needs them, or another modulation frequency.
        """
        if self.network.needs == "samples" and sensed.raw is None:
            raise ValueError(f"raw is None; {self.name} needs the samples of each frame")
        self.require_frequency(sensor)
        # The device follows the network: who wants another moves the network there.
        device = next(self.network.parameters()).device
        engine, count = self.engines.on(device), FRAMES_AT_ONCE[device.type]
        stride = self.stride(*sensed.gray.shape[-2:])

        def predict_from(start: int) -> Prediction:
            some = mapped(lambda tensor: tensor[start : start + count].to(device), sensed)
            return predict_thinned(self.network, some, sensor, stride, forward=engine)

        # The engine sets its own threads. What is around it is small, and torch's threads, once
        # awake for that, would stay in the engine's way.
        with torch_threads(1):
            found = concatenate([predict_from(start) for start in range(0, len(sensed), count)])
            return mapped(lambda tensor: tensor.to(sensed.gray.device), found)

    def require_frequency(self, sensor: SensorDescription) -> None:
        """Raise ValueError unless the network was trained for the sensor's first frequency."""
        if sensor.f1_hz != self.metadata["f1_hz"]:
            trained = f"{self.name} was trained for {self.metadata['f1_hz']:g}"
            raise ValueError(f"f1_hz is {sensor.f1_hz:g}; {trained}")

    def macs(self, height: int, width: int) -> int:
        """Multiply-accumulate operations of a frame of `height` x `width` pixels, once thinned."""
        stride = self.stride(height, width)
        return multiply_accumulates(
            self.network, self.network.example(height // stride, width // stride)
        )


def gray_to_float(gray: Tensor) -> Tensor:
    """Gray images [B, H, W], uint16 in 0..4095 or float in [0, 1], checked, as float32 in [0, 1].

    Raises
    ------
    ValueError
        Another shape, dtype or range, or NaN.
    """
    if not isinstance(gray, Tensor):
        raise TypeError(f"gray is {type(gray).__name__}; expected a torch tensor [B, H, W]")
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
    """Load a trained network: the name of a shipped one, or the path of a safetensors file.

    Raises
    ------
    ValueError
        The file is missing, damaged or no network of this project; the message names it and the
        cure.
    """
    require_path(name_or_path=name_or_path)
    weights = load_weights(_weights_path(name_or_path))
    network = weights.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return Unwrapper(weights.metadata["network"], network, weights.metadata, weights.fingerprint)


def label_of(name_or_path: str | Path) -> WeightsLabel:
    """Which weights `load_unwrapper` would load, without loading them.

    Raises
    ------
    ValueError
        The file is missing, or no network of this project.
    """
    return read_label(_weights_path(name_or_path))


def _weights_path(name_or_path: str | Path) -> Path:
    shipped = str(name_or_path) in PLACES
    return SHIPPED / f"{name_or_path}.safetensors" if shipped else Path(name_or_path)
