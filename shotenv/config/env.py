"""Configuration of the decision problem: sensor, laser, bank, network, merging and reward."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, model_validator

from shotenv.config.families import Split
from shotenv.config.laser import LaserConfig
from shotenv.config.sensor import SensorConfig
from unwrap.support import NonNegative, Positive, Range, Section, check_range

# Assumed limits: beyond them no number is meant, and what it leads to is too large for float32, or
# for the memory.
HEAVIEST = 1e6
"""Weight of a term of the reward; all terms are of the order of 1."""
MOST_FRAMES_OF_A_DRIVE = 1_000_000
"""A day at 10 Hz has 864 000."""


def _both_ends(price: object) -> object:
    """A price as the range that holds it alone: 0.04 is (0.04, 0.04)."""
    return (price, price) if isinstance(price, int | float) else price


class RewardConfig(Section):
    """Weights of the bounded reward terms.

    The reward is relative to what 4 DCS bring in the same frame, and scaled:
    `scale` times (weighted terms of 4 DCS minus weighted terms of what was taken).
    """

    error: NonNegative = Field(1.0, le=HEAVIEST, description="weight of the depth error term")
    duty: NonNegative = Field(
        0.0, le=HEAVIEST, description="weight of laser duty relative to always-8"
    )
    power: Annotated[Range, BeforeValidator(_both_ends)] = Field(
        (0.09, 0.09),
        description="weight of power relative to always-8, its price; (low, high) is drawn "
        "log-uniformly for each drive",
    )
    trip: NonNegative = Field(0.5, le=HEAVIEST, description="weight of a frame without laser")
    error_scale_m: Positive = Field(
        4.0,
        ge=1e-4,
        le=1e5,
        description="error at which a pixel's term |e| / (|e| + scale) is one half, m",
    )
    scale: Positive = Field(20.0, ge=1e-6, le=1e6, description="factor of the reward")

    @model_validator(mode="after")
    def _price_possible(self) -> RewardConfig:
        low, high = self.power
        check_range("power", self.power)
        if low < 0 or high > HEAVIEST:
            raise ValueError(
                f"power is ({low:g}, {high:g}); expected weights from 0 to {HEAVIEST:g}"
            )
        # Log-uniform: a price of 0 lies infinitely far below every other.
        if low == 0 < high:
            raise ValueError(
                f"power is (0, {high:g}); expected a range that begins above 0, or 0 alone"
            )
        return self


class EnvConfig(Section):
    """The decision problem."""

    sensor: SensorConfig
    laser: LaserConfig
    bank: str = Field("pocket", description="name, path or URL of a bank")
    split: Literal[Split, "all"] = Field(
        "train", description="clips that drives are made of; all: those of no held-out family"
    )
    families: tuple[str, ...] = Field(
        (), description="families of the scenes that drives pass; all of the split by default"
    )
    clutter: bool = Field(
        False, description="whether train drives also pass the clips for training networks only"
    )
    unwrapper: str = Field("tofregnet", description="name or path of an unwrapping network")
    # The words of `unwrap.depth`, which would bring torch along; a test compares them.
    merge: Literal["nearest", "floor", "none"] = Field(
        "nearest",
        description="how prediction and wrapped map merge: ours, eq. 6, or the prediction alone",
    )
    eight: Literal["two_frequency", "kernel_density", "network"] = Field(
        "two_frequency",
        description="who tells the wraps of 8 samples: the two frequencies of each pixel, those of "
        "its neighbours too (a vote), or the network",
    )
    protect: bool = Field(
        True,
        description="whether the sensor takes fewer shots, in the end none, where those asked for "
        "would trip the laser",
    )
    frames_per_drive: int = Field(
        256, ge=2, le=MOST_FRAMES_OF_A_DRIVE, description="frames of one episode"
    )
    frame_rate_hz: Positive = Field(10.0, ge=1e-3, le=1e4, description="frames per second")
    reward: RewardConfig = RewardConfig()

    @model_validator(mode="after")
    def _fits_the_frame(self) -> EnvConfig:
        # Eight samples fit, whatever is chosen: the frame rate does not depend on the shots.
        frame_s = 1.0 / self.frame_rate_hz
        acquisition_s = 8 * self.sensor.sample_period_s
        if acquisition_s > frame_s:
            raise ValueError(
                f"frame_rate_hz is {self.frame_rate_hz:g}: eight samples take {acquisition_s:g} s, "
                f"more than the frame period of {frame_s:g} s"
            )
        return self
