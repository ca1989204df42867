"""Frames as an epc660 camera sends them: a header of 25 bytes, then planes of 16-bit words.

The header is big-endian (version, type, columns, rows, region of interest, integration times of
low, mid and high in microseconds, temperature in hundredths of a degree Celsius, offset of the
data); the words after it are little-endian. Gray images may stand between the samples: each goes
with the samples that follow it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from unwrap.cameras.files.camera_description import CameraDescription
from unwrap.cameras.files.stored_frames import StoredFrames, numbered
from unwrap.support import in_one_line, open_regular

WIRE_HEADER = struct.Struct("!BHHHHHHHHHHhH")
CELSIUS_K = 273.15


class _Image(NamedTuple):
    """One image in the file: where its words are and what its header tells."""

    first_byte: int
    is_gray: bool
    integration_s: float
    temperature_k: float


@dataclass(frozen=True)
class WireFrames:
    """Frames of a file of the bytes as they were received.

    Attributes
    ----------
    path : Path
    camera : CameraDescription
    """

    path: Path
    camera: CameraDescription

    @cached_property
    def _walk(self) -> tuple[tuple[_Image, ...], tuple[int, int]]:
        """All images, and their rows and columns; headers alone are read."""
        try:
            with open_regular(self.path) as file:
                images: list[_Image] = []
                size, end = None, self.path.stat().st_size
                while file.tell() < end:
                    frame = sum(not image.is_gray for image in images)
                    head = file.read(WIRE_HEADER.size)
                    if len(head) < WIRE_HEADER.size:
                        raise ValueError(f"frame {frame}: header of {len(head)} bytes; expected 25")
                    fields = WIRE_HEADER.unpack(head)
                    is_gray = self._is_gray(fields[1], frame)
                    found = self._size(fields, frame)
                    if size is not None and found != size:
                        raise ValueError(
                            f"frame {frame}: {found[0]} x {found[1]} pixels; expected "
                            f"{size[0]} x {size[1]}, as the frames before"
                        )
                    size = found
                    bytes_ = 2 * found[0] * found[1] * (1 if is_gray else self.camera.planes)
                    if file.tell() + bytes_ > end:
                        raise ValueError(
                            f"frame {frame}: {end - file.tell()} bytes follow its header; expected "
                            f"{bytes_}: the file is cut off"
                        )
                    low_us, centi = fields[8], fields[11]
                    images.append(
                        _Image(file.tell(), is_gray, low_us * 1e-6, centi / 100 + CELSIUS_K)
                    )
                    file.seek(bytes_, 1)
        except (OSError, ValueError) as error:
            raise ValueError(f"{self.path}: {in_one_line(error)}") from None
        if size is None or all(image.is_gray for image in images):
            raise ValueError(f"{self.path}: no frame of samples")
        return tuple(images), size

    def _is_gray(self, kind: int, frame: int) -> bool:
        layout = self.camera.layout
        if kind not in (layout.dcs_type, layout.gray_type):
            raise ValueError(
                f"frame {frame}: type is {kind}; expected {layout.dcs_type} (samples) or "
                f"{layout.gray_type} (gray image); were bytes lost or swapped?"
            )
        return kind == layout.gray_type

    def _size(self, fields: tuple[int, ...], frame: int) -> tuple[int, int]:
        """Rows and columns that a header tells."""
        columns, rows = fields[2:4]
        height, width = self.camera.layout.height, self.camera.layout.width
        assert height is not None and width is not None  # The description has seen to it.
        if not (1 <= rows <= height and 1 <= columns <= width):
            raise ValueError(
                f"frame {frame}: {rows} x {columns} pixels; expected at most {height} x {width}; "
                "were bytes lost or swapped?"
            )
        return rows, columns

    @cached_property
    def _frames(self) -> tuple[tuple[_Image, _Image | None], ...]:
        """Samples, each with the gray image between it and the samples before."""
        pairs, gray = [], None
        for image in self._walk[0]:
            if image.is_gray:
                gray = image
            else:
                pairs.append((image, gray))
                gray = None
        return tuple(pairs)

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers of the frames of samples."""
        return numbered(len(self._frames))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns of a frame."""
        return (self.camera.planes, *self._walk[1])

    def read(self, start: int, stop: int) -> StoredFrames:
        """Frames `start` to `stop`."""
        frames = self._frames[start:stop]
        with_gray = [gray is not None for _, gray in self._frames]
        if any(with_gray) and not all(with_gray):
            raise ValueError(
                f"{self.path}: frame {with_gray.index(False)} has no gray image; expected one "
                "before each frame of samples, or none at all"
            )
        with self.path.open("rb") as file:
            planes = np.stack([self._words(file, image, self.camera.planes) for image, _ in frames])
            gray = None
            if all(with_gray):
                gray = np.stack([self._words(file, image, 1)[0] for _, image in frames if image])
        return StoredFrames(
            planes,
            gray,
            temperature_k=tuple(image.temperature_k for image, _ in frames),
            integration_s=tuple(image.integration_s for image, _ in frames),
        )

    def _words(self, file, image: _Image, planes: int) -> np.ndarray:
        rows, columns = self._walk[1]
        file.seek(image.first_byte)
        content = file.read(2 * planes * rows * columns)
        return np.frombuffer(content, "<u2").reshape(planes, rows, columns)
