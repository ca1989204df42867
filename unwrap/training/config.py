"""How a network is trained: one typed configuration, a sentence per field."""

from __future__ import annotations

import math
from typing import Literal

import torch
from pydantic import Field

from unwrap.networks import (
    LossWeights,
    Network,
    NetworkName,
    Settings,
    build_network,
    load_unwrapper,
    network_class,
)
from unwrap.signal import SensorDescription, Shots, unambiguous_range_m
from unwrap.support import Section
from unwrap.training.data import Augmentation, SplitBy

MOST_CLASSES, BEYOND = 16, 1.2
"""Wrap classes of a network; truth that is told apart, over the scored range."""


class TrainConfig(Section):
    """Training of an unwrapping network."""

    network: NetworkName = Field("tofregnet", description="which network")
    bank: str = Field("training", description="name, path or URL of the bank to train on")
    split_by: SplitBy = Field(
        "clip", description="whole clips, or the paper's random split of frames"
    )
    sensor: str = Field(
        "epc660",
        description="name or path of the sensor that the network is for: its frequency and ranges",
    )
    truth: Literal["rendered", "measured"] = Field(
        "rendered", description="learn the rendered distance, or the sensor's own of 8 DCS"
    )
    stride: int = Field(1, ge=1, le=8, description="every how many rows and columns are used")
    shots: tuple[Shots, ...] = Field(
        (Shots.TWO, Shots.FOUR), description="samples that a network which looks at them is given"
    )
    memory: bool = Field(False, description="give toffusionnet the depth of the frame before")
    width: int = Field(32, ge=4, le=128, description="channels of the first ResNet stage")
    classes: int = Field(5, ge=2, le=MOST_CLASSES, description="wrap classes of tofsegnet")
    f1_hz: float = Field(
        24e6, ge=1e5, le=1e9, description="frequency whose wraps are predicted, Hz"
    )
    max_range_m: float = Field(25.0, gt=0, le=1e6, description="range that is scored, m")
    clamp_m: float = Field(
        30.0, gt=0, le=1e6, description="truth beyond, and the sky, counts as this, m"
    )
    epochs: int = Field(40, ge=1, le=10**6, description="passes over the training frames")
    batch_size: int = Field(32, ge=1, le=10**5, description="frames per step")
    learning_rate: float = Field(3e-3, gt=0, le=1e3, description="highest learning rate")
    final_learning_rate: float = Field(
        1e-6, ge=0, le=1e3, description="learning rate at the last step"
    )
    warmup_share: float = Field(0.1, ge=0, lt=1, description="share of steps that rise linearly")
    weight_decay: float = Field(0.01, ge=0, le=1e3, description="decoupled decay; 0 is plain Adam")
    clip_norm: float = Field(
        0.0, ge=0, le=1e12, description="longest gradient; longer ones are shortened; 0 leaves all"
    )
    equation_7_weight: float = Field(
        1.0, ge=0, le=1e6, description="weight of the paper's loss, eq. 7"
    )
    equation_7_mean_share: float = Field(
        0.85, ge=0, le=1, description="lambda of L_SI; the paper's 1 leaves the mean error free"
    )
    wrap_weight: float = Field(
        1.0, ge=0, le=1e6, description="weight of our wrap loss; 0 as in the paper"
    )
    flip_horizontal: bool = Field(True, description="mirror left and right")
    flip_vertical: bool = Field(False, description="mirror up and down, as the paper does too")
    contrast: float = Field(0.2, ge=0, le=10, description="largest relative change of gamma")
    brightness: float = Field(0.3, ge=0, le=10, description="largest relative change of gain")
    seed: int = Field(0, ge=0, le=2**62, description="seed of weights, order and augmentation")
    start_from: str | None = Field(
        None, description="name or path of a network whose layers of equal shape are taken over"
    )

    @property
    def settings(self) -> Settings:
        """What the network is built from."""
        return Settings(self.width, self.clamp_m, self.classes, self.f1_hz)

    @property
    def shown_shots(self) -> tuple[Shots, ...]:
        """Samples that frames come with; none where the network looks at the gray image alone."""
        return self.shots if network_class(self.network).needs == "samples" else ()

    @property
    def loss_weights(self) -> LossWeights:
        """How the terms of a regression loss count."""
        return LossWeights(self.equation_7_weight, self.equation_7_mean_share, self.wrap_weight)

    @property
    def augmentation(self) -> Augmentation:
        """How training images are varied."""
        return Augmentation(
            self.flip_horizontal, self.flip_vertical, self.contrast, self.brightness
        )

    def at_sensor(self, sensor: SensorDescription) -> TrainConfig:
        """With the frequency, the ranges and the classes of a sensor, where none is chosen here.

        What has its default value counts as not chosen. Classes are one for each wrap within the
        scored range; of a network that has no classes they stay as they are.

        Raises
        ------
        ValueError
            A network that looks at samples is to be of another frequency than its samples; or
            the scored range has more wraps than a network has classes.

        Examples
        --------
        >>> sensor = SensorDescription(f1_hz=60e6, f2_hz=25e6, max_range_m=20.0)
        >>> config = TrainConfig(network="tofsegnet").at_sensor(sensor)
        >>> config.f1_hz, config.max_range_m, config.clamp_m, config.classes
        (60000000.0, 20.0, 24.0, 9)
        """
        follow = {"f1_hz": sensor.f1_hz, "max_range_m": sensor.max_range_m}
        found = self._where_unchosen(follow)
        if found.shown_shots and found.f1_hz != sensor.f1_hz:
            raise ValueError(
                f"f1_hz is {found.f1_hz:g}, but sensor {self.sensor} samples at {sensor.f1_hz:g}, "
                f"and {self.network} looks at samples; expected that, or another sensor"
            )
        found = found._where_unchosen({"clamp_m": BEYOND * found.max_range_m})
        if not network_class(self.network).uses_classes:
            return found
        classes = math.floor(found.max_range_m / unambiguous_range_m(found.f1_hz)) + 1
        if classes > MOST_CLASSES and found.classes == TrainConfig().classes:
            raise ValueError(
                f"max_range_m is {found.max_range_m:g}, within which {classes} wraps of "
                f"{unambiguous_range_m(found.f1_hz):.3g} m begin; expected at most {MOST_CLASSES}, "
                "or a network without classes, such as tofregnet"
            )
        return found._where_unchosen({"classes": classes})

    def _where_unchosen(self, values: dict[str, float]) -> TrainConfig:
        """A copy with the `values` of those fields that have their default."""
        fields = TrainConfig.model_fields
        new = {name: v for name, v in values.items() if getattr(self, name) == fields[name].default}
        return TrainConfig(**{**self.model_dump(), **new})

    def build(self) -> Network:
        """The network, with weights drawn from `seed`."""
        # Layers draw their weights from torch's global generator, which is as before afterwards.
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(self.seed)
            network = build_network(self.network, self.settings)
        if self.start_from is not None:
            transfer_layers_(network, load_unwrapper(self.start_from).network)
        return network


def transfer_layers_(network: Network, other: Network) -> None:
    """Overwrite the layers of `network` that have the same name and shape in `other`.

    Raises
    ------
    ValueError
        There is none, as the widths differ.
    """
    own = network.state_dict()
    # Tensors without axes are counters of batches, which every network has: no layer is shared
    # where only they fit.
    shared = {
        name: tensor
        for name, tensor in other.state_dict().items()
        if name in own and own[name].shape == tensor.shape and tensor.ndim > 0
    }
    if not shared:
        raise ValueError(
            f"start_from has width {other.settings.width}; expected {network.settings.width}"
        )
    network.load_state_dict({**own, **shared})
