"""Frames as they lie in a file, before anything is made of them; what every reader gives."""

from __future__ import annotations

import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

BROKEN = (
    *(OSError, ValueError, KeyError, EOFError, NotImplementedError, RuntimeError, TypeError),
    *(zipfile.BadZipFile, zlib.error, struct.error),
)
"""What reading damaged files raises."""


@dataclass(frozen=True)
class StoredFrames:
    """Planes and what a file tells beside them.

    Attributes
    ----------
    planes : [F, P, H, W]
        Stored numbers, frequency by frequency in the order of the description.
    gray : [F, H, W] or None
        Passive images, stored numbers.
    frequencies_hz : tuple of float or None
        In the order of the planes; None where the file does not tell.
    saturated : bool [F, P, H, W] or None
        Samples that the camera flags beside their words: taps that were full.
    temperature_k, integration_s, laser_power_w, timestamp_s : tuple of F floats or None
    """

    planes: np.ndarray
    gray: np.ndarray | None = None
    frequencies_hz: tuple[float, ...] | None = None
    saturated: np.ndarray | None = None
    temperature_k: tuple[float, ...] | None = None
    integration_s: tuple[float, ...] | None = None
    laser_power_w: tuple[float, ...] | None = None
    timestamp_s: tuple[float, ...] | None = None


class FrameSource(Protocol):
    """A file, or a folder of files, that frames are read from piece by piece.

    Attributes
    ----------
    path : Path
    names : tuple of str
        Of the frames.
    shape : tuple of int
        Planes, rows and columns of a frame.
    """

    @property
    def path(self) -> Path:
        """File or folder."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the frames."""

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns of a frame."""

    def read(self, start: int, stop: int) -> StoredFrames:
        """Frames `start` to `stop`.

        Raises
        ------
        ValueError
            What is damaged; the message names the file and the frame.
        """


def numbered(frames: int) -> tuple[str, ...]:
    """Names of frames that have none."""
    return tuple(f"{number:05d}" for number in range(frames))
