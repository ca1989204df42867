"""The public face: a trained network by name or path, its predictions, and the correction."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from unwrap.correction import Merge, SensorDescription, correct
from unwrap.data import GRAY_FULL_SCALE
from unwrap.nets import (
    NETWORKS,
    Autoencoder,
    TofSegNet,
    autocast,
    class_depth_m,
    multiply_accumulates,
)
from unwrap.phase import unambiguous_range_m
from unwrap.weights import load_weights

__all__ = ["Merge", "Prediction", "SensorDescription", "Unwrapper", "correct", "load_unwrapper"]

SHIPPED = Path(__file__).parent / "weights"


@dataclass(frozen=True)
class Prediction:
    """What a network makes of a gray image.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Coarse distance, metres.
    confidence : float32 [B, H, W]
        0..1, see `Unwrapper.predict`.
    """

    distance_m: Tensor
    confidence: Tensor


@dataclass(frozen=True)
class Unwrapper:
    """A trained network, ready to predict.

    Attributes
    ----------
    name : str
        "tofregnet" or "tofsegnet".
    network : Autoencoder
        In evaluation mode.
    metadata : dict
        What is stored with the weights: width, frequency, training bank, recipe.
    fingerprint : str
        SHA-256 of the weights; predictions may be kept under this key.
    """

    name: str
    network: Autoencoder = field(repr=False)
    metadata: dict = field(repr=False)
    fingerprint: str

    @property
    def unambiguous_m(self) -> float:
        """Unambiguous range that the network was trained for, metres."""
        return unambiguous_range_m(self.metadata["f1_hz"])

    @torch.inference_mode()
    def predict(self, gray: Tensor) -> Prediction:
        """Coarse distance from gray images [B, H, W]: uint16 in 0..4095, or float in [0, 1].

        TofSegNet predicts a distance within its likeliest class (see `nets.class_depth_m`), with
        that class's probability as confidence. TofRegNet's confidence is the distance from its
        prediction to the nearest wrap boundary over half the unambiguous range: 0 on a boundary,
        1 halfway between two.

        Frames are computed one by one, so that a prediction does not depend on its batch.

        Raises
        ------
        ValueError
            Another shape, dtype or range, or NaN.
        """
        images = _as_float(gray)
        device = next(self.network.parameters()).device
        with autocast(device):
            outputs = [self.network(image[None, None].to(device)) for image in images]
        output = torch.cat(outputs).to(gray.device)
        return self._classes(output) if isinstance(self.network, TofSegNet) else self._depth(output)

    def _classes(self, logits: Tensor) -> Prediction:
        confidence = logits.float().softmax(1).amax(1)
        return Prediction(class_depth_m(logits, self.unambiguous_m), confidence)

    def _depth(self, depth_m: Tensor) -> Prediction:
        cycles = depth_m / self.unambiguous_m
        return Prediction(depth_m, 2 * (cycles - cycles.round()).abs())

    def macs(self, height: int, width: int) -> int:
        """Multiply-accumulate operations of one frame of `height` x `width` pixels."""
        return multiply_accumulates(self.network, height, width)


def _as_float(gray: Tensor) -> Tensor:
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
    """A trained network: "tofregnet", "tofsegnet", or the path of a safetensors file.

    Raises
    ------
    ValueError
        The file is missing, damaged or no network of this project; the message names it and the
        cure.
    """
    shipped = str(name_or_path) in NETWORKS
    path = SHIPPED / f"{name_or_path}.safetensors" if shipped else Path(name_or_path)
    weights = load_weights(path)
    network = weights.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    return Unwrapper(weights.metadata["network"], network, weights.metadata, weights.fingerprint)
