"""What every unwrapping network is: input maps in, output maps out, a loss, a prediction."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, Self

import torch
from torch import Tensor, nn

from unwrap.networks.losses import LossWeights
from unwrap.signal import RawFrame, Sensed, SensorDescription, Truth, unambiguous_range_m

Needs = Literal["gray", "samples"]
"""What a network looks at: the gray image alone, or the samples, too."""
Draw = Callable[..., Tensor]
"""`draw(*shape)` gives random numbers of [0, 1), float32 [B, *shape], for the frames of a batch."""


@dataclass(frozen=True)
class Prediction:
    """What a network makes of a frame; batch B.

    Attributes
    ----------
    distance_m : float32 [B, H, W]
        Distance, metres; coarse where the network has seen the gray image alone.
    confidence : float32 [B, H, W]
        0..1; what it means is the network's own, see its `predict`.
    """

    distance_m: Tensor
    confidence: Tensor


@dataclass(frozen=True)
class Settings:
    """What is needed to build a network; checked here, since it may come from a file.

    Attributes
    ----------
    width : int
        Channels of the first stage; the others scale with it.
    range_m : float
        Largest distance predicted, metres.
    classes : int
        Wrap classes; the last is all beyond.
    f1_hz : float
        Modulation frequency whose wraps are predicted.
    """

    width: int = 64
    range_m: float = 30.0
    classes: int = 5
    f1_hz: float = 24e6

    def __post_init__(self) -> None:
        # Bounds far beyond what is in use, so that a forged file cannot ask for all memory.
        for name, low, high in (("width", 4, 128), ("classes", 2, 16)):
            value = getattr(self, name)
            if not (isinstance(value, int) and low <= value <= high):
                raise ValueError(f"{name} is {value!r}; expected a whole number {low} to {high}")
        for name in ("range_m", "f1_hz"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0 < value < 1e12):
                raise ValueError(f"{name} is {value!r}; expected a positive number")

    @classmethod
    def of(cls, metadata: Mapping[str, Any]) -> Self:
        """Settings among `metadata`; what is missing has its default."""
        names = ("width", "range_m", "classes", "f1_hz")
        return cls(**{name: metadata[name] for name in names if name in metadata})

    @property
    def unambiguous_m(self) -> float:
        """Width of a wrap, metres."""
        return unambiguous_range_m(self.f1_hz)


class Network(nn.Module):
    """Base of all networks.

    A frame passes a network in three steps, of which only the second has weights::

        features = network.features(sensed, sensor)  # what it looks at, as maps
        output = network(features)
        prediction = network.predict(output, sensed, sensor)  # metres and confidence

    Training puts `as_trained_on` before the first and `loss` in place of the third. A new network
    overrides `features`, `forward`, `loss` and `predict`, and says what it looks at (`needs`).

    Attributes
    ----------
    needs : "gray" or "samples"
        What of a frame it looks at.
    uses_classes : bool
        Whether it tells wraps apart, of which it must have as many as there are in the range.
    can_be_traced : bool
        Whether the forward pass of one shape is a fixed chain of operations that torch can record.
    """

    needs: ClassVar[Needs] = "gray"
    uses_classes: ClassVar[bool] = True
    can_be_traced: ClassVar[bool] = True

    def __init__(self, settings: Settings):
        super().__init__()
        self.settings = settings

    @classmethod
    def from_settings(cls, settings: Settings) -> Self:
        """An untrained network; for classes whose constructor takes something else to override."""
        return cls(settings)

    @abstractmethod
    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """Input maps of `forward`, float32 [B, C, H, W], of frames that the sensor delivered."""

    def as_trained_on(self, sensed: Sensed, draw: Draw) -> Sensed:
        """Frames as they are shown in training; most networks are shown them as they are.

        `draw` gives what is random in it: frame by frame, so that processes that share a batch
        draw what one with the whole batch does.
        """
        return sensed

    def example(self, height: int, width: int) -> Tensor:
        """Features of a blank frame [1, C, H, W]."""
        blank = torch.zeros(1, height, width, device=next(self.parameters()).device)
        # Four samples, whatever is looked at: who needs none ignores them. Noise is 1, as
        # signal-to-noise divides by it.
        raw = RawFrame(blank.unsqueeze(1).expand(-1, 4, -1, -1), blank.bool())
        sensed = Sensed(blank, raw, noise_lsb=blank + 1)
        return self.features(sensed, SensorDescription(f1_hz=self.settings.f1_hz))

    @abstractmethod
    def loss(
        self,
        output: Tensor,
        sensed: Sensed,
        truth: Truth,
        sensor: SensorDescription,
        weights: LossWeights,
    ) -> Tensor:
        """Scalar to be made small, from what `forward` gave.

        Means are over the whole batch, of which this may be a share: see `LossWeights.total`. The
        other `weights` may go unused.
        """

    def calibrate(
        self,
        batches: Iterable[tuple[Sensed, Truth]],
        sensor: SensorDescription,
        pooled: Callable[[list], list] = list,
    ) -> None:
        """Fit what turns scores into probabilities, after training; most have nothing to fit.

        Of processes that share the `batches` each has its own; `pooled` makes a list with an item
        per batch that of all.
        """

    @abstractmethod
    def predict(self, output: Tensor, sensed: Sensed, sensor: SensorDescription) -> Prediction:
        """Distance and confidence, from what `forward` gave."""


def autocast(device: torch.device) -> torch.autocast:
    """bfloat16 arithmetic inside the context where the device is faster with it."""
    if device.type == "cuda":
        # GPUs before 2020 emulate it, which is slower than float32.
        supported = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        # Older versions of torch cannot tell; float32 is right then, if slower.
        capabilities: dict = getattr(torch.cpu, "get_capabilities", dict)()
        supported = capabilities.get("avx512_bf16", False)
    return torch.autocast(device.type, torch.bfloat16, enabled=bool(supported))


def arithmetic(device: torch.device) -> torch.dtype:
    """Type that a network's weights are multiplied in on `device`, see `autocast`."""
    with autocast(device):
        enabled = torch.is_autocast_enabled(device.type)
        return torch.get_autocast_dtype(device.type) if enabled else torch.float32


@torch.inference_mode()
def multiply_accumulates(network: nn.Module, features: Tensor) -> int:
    """Multiply-accumulate operations of the convolutions for `features` [1, C, H, W]."""
    counts = []

    def count(layer: Any, inputs: tuple[Tensor], output: Tensor) -> None:
        # Each weight is used once per output pixel, or per input pixel of a transposed layer.
        pixels = inputs[0] if isinstance(layer, nn.ConvTranspose2d) else output
        counts.append(layer.weight.numel() * pixels.shape[-2] * pixels.shape[-1])

    layers = [m for m in network.modules() if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)]
    handles = [layer.register_forward_hook(count) for layer in layers]
    try:
        network(features)
    finally:
        for handle in handles:
            handle.remove()
    return sum(counts)
