"""What a live camera must do to be scheduled, and by what names its failures go."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from torch import Tensor

from unwrap.signal import Shots


class CameraError(Exception):
    """A camera that cannot go on; the message names the camera and what was expected."""


class CameraTimeoutError(CameraError):
    """Nothing came in time."""


class CameraDisconnectedError(CameraError):
    """There is no connection, or it was dropped."""


class TruncatedFrameError(CameraError):
    """A frame began to come and did not end."""


class DamagedFrameError(CameraError):
    """What came is no frame as described, or not the one that was asked for."""


class StaleFrameError(CameraError):
    """What came is of another instant than what it would be used with."""


@dataclass(frozen=True)
class GrayFrame:
    """The passive image that a frame begins with.

    Attributes
    ----------
    words : uint16 [H, W]
        0..4095.
    exposure_s : float
        Of this image.
    """

    words: Tensor
    exposure_s: float


@dataclass(frozen=True)
class Samples:
    """Samples of one frame, in the order of `unwrap.signal.shots`.

    Attributes
    ----------
    dcs_lsb : float32 [n, H, W]
        n = 2, 4 or 8; 0 where a full pixel has no sample.
    saturated : bool [n, H, W]
        Where each sample is none: the pixel full, or its word beyond the converter.
    """

    dcs_lsb: Tensor
    saturated: Tensor


class Camera(Protocol):
    """A camera that takes what is asked for: of each frame the gray image first, then samples.

    Each method raises a `CameraError` where the camera fails.
    """

    @property
    def name(self) -> str:
        """What it is called in messages."""

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of its images."""

    @property
    def laser_power_w(self) -> float:
        """Optical power while on."""

    @property
    def integration_s(self) -> float:
        """Time of one sample."""

    def start(self) -> None:
        """Connect and set it up; nothing where it runs."""

    def next_frame(self) -> GrayFrame:
        """Wait for the next frame and take its gray image."""

    def acquire(self, shots: Shots) -> Samples:
        """Take samples of the frame that the last gray image began."""

    def temperature_k(self) -> float:
        """Temperature of the imager, kelvin."""

    def close(self) -> None:
        """Let go of it; nothing where that was done."""
