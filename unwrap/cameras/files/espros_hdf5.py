"""HDF5 files of ESPROS's epc660 software: one type of image a file, told by root attributes.

`frames_0` holds [N, 4, H, W] samples centred on zero (`image_type` DCS), or [N, H, W] of anything
else, such as the gray images (Grayscale); `timestamps` [N] their times in seconds.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from unwrap.cameras.files.camera_description import CameraDescription
from unwrap.cameras.files.hdf5_files import opened_hdf5
from unwrap.cameras.files.stored_frames import StoredFrames, numbered

SAMPLES, GRAY = "DCS", "Grayscale"
"""Values of `image_type`."""
FRAMES, TIMES = "frames_0", "timestamps"


@dataclass(frozen=True)
class EsprosFile:
    """Frames of one file.

    Attributes
    ----------
    path : Path
    camera : CameraDescription
    image_type : "DCS" or "Grayscale"
        What the file is expected to hold.
    """

    path: Path
    camera: CameraDescription
    image_type: str = SAMPLES

    @cached_property
    def _head(self) -> tuple[tuple[int, ...], float | None]:
        """Shape of all frames and the modulation frequency in Hz, if told."""
        with opened_hdf5(self.path) as file:
            kind = _text(file.attrs.get("image_type"))
            if kind != self.image_type:
                raise ValueError(
                    f"image_type is {kind!r}; expected {self.image_type!r}: a file holds one type "
                    "of image, so that samples and gray images are two files"
                )
            if FRAMES not in file:
                raise ValueError(f"{FRAMES} is missing; it has {', '.join(file) or 'nothing'}")
            shape = file[FRAMES].shape
            planes = (self.camera.planes,) if self.image_type == SAMPLES else ()
            if len(shape) != 3 + len(planes) or shape[1:-2] != planes or 0 in shape:
                expected = ", ".join(("N", *map(str, planes), "H", "W"))
                raise ValueError(f"{FRAMES} has shape {shape}; expected [{expected}]")
            self._check_region(file.attrs.get("roi"), shape[-2:])
            megahertz = file.attrs.get("mod_frequency")
            return shape, None if megahertz is None else float(megahertz) * 1e6

    def _check_region(self, region: Any, size: tuple[int, ...]) -> None:
        """Raise ValueError where the region of interest, x0 y0 x1 y1, has another size."""
        if region is None:
            return
        left, top, right, bottom = (int(edge) for edge in region)
        if (bottom - top, right - left) != size:
            raise ValueError(
                f"{FRAMES} has images of {size[0]} x {size[1]}; expected {bottom - top} x "
                f"{right - left}, as roi {(left, top, right, bottom)} tells"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers of the frames."""
        return numbered(self._head[0][0])

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns of a frame."""
        _, *planes, height, width = self._head[0]
        return (planes[0] if planes else 1), height, width

    def read(self, start: int, stop: int) -> StoredFrames:
        """Frames `start` to `stop`; of gray images their planes are the images."""
        told_hz = self._head[1]
        with opened_hdf5(self.path) as file:
            planes = file[FRAMES][start:stop]
            times = None
            if TIMES in file:
                if len(file[TIMES]) != len(self.names):
                    raise ValueError(
                        f"{TIMES} has {len(file[TIMES])} entries; expected {len(self.names)}, one "
                        "for each frame"
                    )
                times = tuple(float(time) for time in file[TIMES][start:stop])
        if planes.ndim == 3:
            planes = planes[:, None]
        told = None if told_hz is None else (told_hz,)
        return StoredFrames(np.asarray(planes), frequencies_hz=told, timestamp_s=times)


def _text(value: Any) -> Any:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value
