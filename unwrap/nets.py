"""TofRegNet and TofSegNet: a ResNet18 autoencoder from one gray image to depth or wrap class.

Both share one body (`Autoencoder`): a feature-extraction stem, the four stages of a ResNet18 and a
decoder of four transposed and four plain convolutions in sequence, with skip connections. `width`
scales all channels; 64 gives ResNet18's own.
"""

from __future__ import annotations

from operator import add
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

NETWORKS = ("tofregnet", "tofsegnet")
STRIDE = 32
"""The body halves the image five times; inputs are padded to a multiple of this."""
DARKEST = 1e-3
"""Gray level added before the logarithm, about four steps of a 12-bit converter."""


class BasicBlock(nn.Module):
    """Two 3x3 convolutions and a shortcut (He et al. 2016)."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1):
        super().__init__()
        self.first = convolution(inputs, outputs, stride=stride)
        self.second = convolution(outputs, outputs, active=False)
        same = stride == 1 and inputs == outputs
        self.shortcut = (
            nn.Identity()
            if same
            else convolution(inputs, outputs, kernel=1, stride=stride, active=False)
        )

    def forward(self, features: Tensor) -> Tensor:
        """[B, inputs, H, W] -> [B, outputs, H / stride, W / stride]."""
        return functional.relu(self.second(self.first(features)) + self.shortcut(features))


def convolution(
    inputs: int, outputs: int, *, kernel: int = 3, stride: int = 1, active: bool = True
) -> nn.Sequential:
    """Convolution without bias, batch normalisation and, where `active`, a ReLU."""
    layers = [
        nn.Conv2d(inputs, outputs, kernel, stride, kernel // 2, bias=False),
        nn.BatchNorm2d(outputs),
    ]
    return nn.Sequential(*layers, *([nn.ReLU()] if active else []))


def doubling(inputs: int, outputs: int) -> nn.Sequential:
    """Transposed convolution that doubles height and width, normalised, with a ReLU."""
    transposed = nn.ConvTranspose2d(inputs, outputs, 2, stride=2, bias=False)
    return nn.Sequential(transposed, nn.BatchNorm2d(outputs), nn.ReLU())


def stage(inputs: int, outputs: int, stride: int) -> nn.Sequential:
    """One ResNet18 stage: two basic blocks, the first with `stride`."""
    return nn.Sequential(BasicBlock(inputs, outputs, stride), BasicBlock(outputs, outputs))


class Autoencoder(nn.Module):
    """Gray image to `outputs` maps at the input's resolution, for any height and width.

    Parameters
    ----------
    width : int
        Channels of the first stage; the others have twice, four and eight times as many.
    outputs : int
        Maps per pixel.
    """

    def __init__(self, width: int, outputs: int):
        super().__init__()
        self.width = width
        channels = (width, 2 * width, 4 * width, 8 * width)
        self.stem = convolution(3, width, kernel=7, stride=2)
        self.encoder = nn.ModuleList(
            stage(inputs, outputs, stride)
            for inputs, outputs, stride in zip(
                (width, *channels), channels, (1, 2, 2, 2), strict=False
            )
        )
        # Deepest first: the skips are stages three, two and one, then the stem.
        skips = (4 * width, 2 * width, width, width)
        decoded = (8 * width, 4 * width, 2 * width, width, width // 2)
        self.up = nn.ModuleList(map(doubling, decoded[:-1], decoded[1:]))
        self.plain = nn.ModuleList(map(convolution, map(add, decoded[1:], skips), decoded[1:]))
        # The last doubling rearranges channels into 2 x 2 pixels.
        self.head = nn.Conv2d(width // 2, 4 * outputs, 1)

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> [B, outputs, H, W]."""
        height, width = gray.shape[-2:]
        features = self.stem(describe(pad(gray)))
        skips = [features]
        features = functional.max_pool2d(features, 3, 2, 1)
        for encode in self.encoder:
            features = encode(features)
            skips.append(features)
        features = skips.pop()
        for up, plain in zip(self.up, self.plain, strict=True):
            features = plain(torch.cat((up(features), skips.pop()), 1))
        maps = functional.pixel_shuffle(self.head(features), 2)
        return maps[..., :height, :width]


def pad(gray: Tensor) -> Tensor:
    """Repeat the last row and column until height and width are multiples of `STRIDE`."""
    height, width = gray.shape[-2:]
    missing = (0, -width % STRIDE, 0, -height % STRIDE)
    return functional.pad(gray, missing, mode="replicate") if any(missing) else gray


def describe(gray: Tensor) -> Tensor:
    """[B, 1, H, W] -> [B, 3, H, W]: gray, its logarithm, and the row, all within [-1, 1].

    The logarithm turns exposure into an offset and opens the shadows; the row tells where the
    horizon of a camera in its usual attitude is.
    """
    height, width = gray.shape[-2:]
    row = torch.linspace(-1.0, 1.0, height, device=gray.device, dtype=gray.dtype)
    rows = row[None, None, :, None].expand(len(gray), 1, height, width)
    logarithm = (gray + DARKEST).log() / 3.5 + 1.0
    features = torch.cat((2.0 * gray - 1.0, logarithm, rows), 1)
    return features.contiguous(memory_format=torch.channels_last)


def autocast(device: torch.device) -> torch.autocast:
    """bfloat16 arithmetic inside the context where the device is faster with it."""
    if device.type == "cuda":
        supported = torch.cuda.is_bf16_supported()
    else:
        capabilities: dict = getattr(torch.cpu, "get_capabilities", dict)()
        supported = capabilities.get("avx512_bf16", False)
    return torch.autocast(device.type, torch.bfloat16, enabled=bool(supported))


@torch.inference_mode()
def multiply_accumulates(network: nn.Module, height: int, width: int) -> int:
    """Multiply-accumulate operations of the convolutions of one frame of `height` x `width`."""
    counts = []

    def count(layer: Any, inputs: tuple[Tensor], output: Tensor) -> None:
        # Each weight is used once per output pixel, or per input pixel of a transposed layer.
        pixels = inputs[0] if isinstance(layer, nn.ConvTranspose2d) else output
        counts.append(layer.weight.numel() * pixels.shape[-2] * pixels.shape[-1])

    layers = [m for m in network.modules() if isinstance(m, nn.Conv2d | nn.ConvTranspose2d)]
    handles = [layer.register_forward_hook(count) for layer in layers]
    try:
        network(torch.zeros(1, 1, height, width, device=layers[0].weight.device))
    finally:
        for handle in handles:
            handle.remove()
    return sum(counts)


class TofRegNet(Autoencoder):
    """Gray image to coarse depth in metres.

    Parameters
    ----------
    width : int
        Channels of the first ResNet stage.
    range_m : float
        Depths lie between 0 and this, metres.
    """

    def __init__(self, width: int = 64, range_m: float = 30.0):
        super().__init__(width, 1)
        self.range_m = range_m

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> depth [B, H, W], metres, in (0, range_m)."""
        return torch.sigmoid(super().forward(gray)[:, 0].float()) * self.range_m


class TofSegNet(Autoencoder):
    """Gray image to the logits of each pixel's wrap class; the last class is all beyond.

    Parameters
    ----------
    width : int
        Channels of the first ResNet stage.
    classes : int
        Wrap classes 0 .. classes - 1, each one unambiguous range wide.
    """

    def __init__(self, width: int = 64, classes: int = 5):
        super().__init__(width, classes)
        self.classes = classes

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> logits [B, classes, H, W]."""
        return super().forward(gray).float()


def class_depth_m(logits: Tensor, unambiguous_m: float) -> Tensor:
    """Coarse distance [B, H, W] that wrap-class logits [B, classes, H, W] stand for, metres.

    The expectation over the classes' middles, kept within the likeliest class: eq. 8's floor gives
    that class, and where two classes are about as likely the distance lies at their boundary, so
    that the nearest candidate is right on either side of it.
    """
    probability = logits.float().softmax(1)
    likeliest = probability.argmax(1)
    middles = torch.arange(logits.shape[1], device=logits.device)[:, None, None] + 0.5
    expected = (probability * middles).sum(1)
    # A margin of a millionth keeps rounding from leaving the class.
    return expected.clamp(likeliest + 1e-6, likeliest + (1 - 1e-6)) * unambiguous_m
