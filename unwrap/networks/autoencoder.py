"""ResNet18 autoencoder: the body of TofRegNet, TofSegNet, TofFusionNet and ChenNet, and its parts.

A feature-extraction stem, the four stages of a ResNet18 (He et al. 2016), and a decoder of four
transposed and four plain convolutions in sequence, with skip connections. `width` scales all
channels; 64 gives ResNet18's own.
"""

from __future__ import annotations

from operator import add

import torch
from torch import Tensor, nn
from torch.nn import functional

from unwrap.networks.input_maps import gray_maps
from unwrap.networks.network import Network, Settings
from unwrap.signal import Sensed, SensorDescription

STRIDE = 32
"""The body halves the image five times; inputs are padded to a multiple of this."""


class BasicBlock(nn.Module):
    """Two 3x3 convolutions and a shortcut (He et al. 2016)."""

    def __init__(self, inputs: int, outputs: int, stride: int = 1):
        super().__init__()
        self.stride = stride
        self.first = convolution(inputs, outputs, stride=stride)
        self.second = convolution(outputs, outputs, active=False)
        same = stride == 1 and inputs == outputs
        self.shortcut = (
            nn.Identity() if same else convolution(inputs, outputs, kernel=1, active=False)
        )

    def forward(self, features: Tensor) -> Tensor:
        """[B, inputs, H, W] -> [B, outputs, H / stride, W / stride]."""
        # The shortcut's stride is a slice: oneDNN 3.12 writes past its workspace when it computes
        # the weights' gradient of strided 1 x 1 kernels on channels-last inputs that have fewer
        # channels than a vector has floats (8 with AVX2, 16 with AVX-512).
        kept = features[..., :: self.stride, :: self.stride]
        return functional.relu(self.second(self.first(features)) + self.shortcut(kept))


def convolution(
    inputs: int, outputs: int, *, kernel: int = 3, stride: int = 1, active: bool = True
) -> nn.Sequential:
    """Convolution without bias, batch normalisation and, where `active`, a ReLU."""
    # Without bias: the normalisation behind would subtract it.
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


class Autoencoder(Network):
    """Images to `outputs` maps at the input's resolution, for any height and width.

    Parameters
    ----------
    settings : Settings
        Of these `width`: channels of the first stage; the others have twice, four and eight times
        as many.
    inputs, outputs : int
        Maps per pixel that the stem takes, and that come out.
    """

    def __init__(self, settings: Settings, inputs: int, outputs: int):
        super().__init__(settings)
        self.width = width = settings.width
        channels = (width, 2 * width, 4 * width, 8 * width)
        self.stem = convolution(inputs, width, kernel=7, stride=2)
        # Each stage takes what the one before gives, the first what the stem gives: one entry more
        # on the left, which is why the lengths differ.
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
        # The last doubling rearranges channels into 2 x 2 pixels: a transposed convolution there
        # would compute at full resolution.
        self.head = nn.Conv2d(width // 2, 4 * outputs, 1)

    def forward(self, images: Tensor) -> Tensor:
        """images [B, inputs, H, W], H and W multiples of `STRIDE` -> [B, outputs, H, W]."""
        features = self.stem(images)
        skips = [features]
        features = functional.max_pool2d(features, 3, 2, 1)
        for encode in self.encoder:
            features = encode(features)
            skips.append(features)
        features = skips.pop()
        for up, plain in zip(self.up, self.plain, strict=True):
            features = plain(torch.cat((up(features), skips.pop()), 1))
        return functional.pixel_shuffle(self.head(features), 2)


def pad(images: Tensor) -> Tensor:
    """Repeat the last row and column until height and width are multiples of `STRIDE`.

    Examples
    --------
    >>> pad(torch.zeros(1, 1, 30, 64)).shape
    torch.Size([1, 1, 32, 64])
    """
    height, width = images.shape[-2:]
    missing = (0, -width % STRIDE, 0, -height % STRIDE)
    return functional.pad(images, missing, mode="replicate") if any(missing) else images


class GrayNetwork(Autoencoder):
    """An autoencoder that looks at the gray image alone."""

    def __init__(self, settings: Settings, outputs: int):
        super().__init__(settings, 3, outputs)

    def forward(self, gray: Tensor) -> Tensor:
        """gray [B, 1, H, W] in [0, 1] -> [B, outputs, H, W], for any H and W."""
        height, width = gray.shape[-2:]
        return super().forward(gray_maps(pad(gray)))[..., :height, :width]

    def features(self, sensed: Sensed, sensor: SensorDescription) -> Tensor:
        """The gray image."""
        return sensed.gray.unsqueeze(1)
