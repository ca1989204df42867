"""Plain arrays: `.npy`, `.npz`, and folders of 16-bit PNG files, with axes as the camera's say."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from unwrap.cameras.files.camera_description import CameraDescription
from unwrap.cameras.files.stored_frames import BROKEN, StoredFrames, numbered
from unwrap.recordings import read_png_folder
from unwrap.support import in_one_line, open_regular, read_arrays, read_npy_header

PER_FRAME = ("temperature_k", "integration_s", "laser_power_w", "timestamp_s")
KNOWN = ("dcs", "gray", "saturated", "frequencies_hz", *PER_FRAME)
"""What an `.npz` file may hold: `dcs` are the planes, `gray` [F, H, W], `saturated` flags of full
taps as `dcs` or [F, H, W], one number a frame the others."""


@dataclass(frozen=True)
class ArrayFrames:
    """Frames of an array.

    Attributes
    ----------
    path : Path
    camera : CameraDescription
    """

    path: Path
    camera: CameraDescription

    @cached_property
    def _arrays(self) -> dict[str, np.ndarray]:
        """Everything there is, by name; of an `.npy` file a map of the file, not its content."""
        if self.path.is_dir():
            return read_png_folder(self.path)[0]
        if self.path.suffix == ".npy":
            return {"dcs": _mapped(self.path)}
        return read_arrays(self.path, "dcs", KNOWN)

    @cached_property
    def _axes(self) -> str:
        """Axes of the array of planes, F left out where it has none."""
        arrays, axes = self._arrays, self.camera.layout.axes
        assert axes is not None  # The description has seen to it.
        if "dcs" not in arrays:
            raise ValueError(f"{self.path}: dcs is missing; expected {', '.join(axes)}")
        dcs = arrays["dcs"]
        # Folders of images have their own order.
        axes = ("FPHW" if dcs.ndim == 4 else "PHW") if self.path.is_dir() else axes
        if "F" in axes and dcs.ndim == len(axes) - 1:
            axes = axes.replace("F", "")  # One frame, saved without its axis.
        if dcs.ndim != len(axes) or 0 in dcs.shape:
            raise ValueError(
                f"{self.path}: {dcs.ndim} axes, shape {dcs.shape}; expected {', '.join(axes)}"
            )
        return axes

    @cached_property
    def _planes(self) -> np.ndarray:
        """Planes [F, P, H, W], a view."""
        axes = self._axes  # First, since it looks whether there is an array.
        planes = _in_order(self._arrays["dcs"], axes)
        if planes.shape[1] != self.camera.stored_planes:
            raise ValueError(
                f"{self.path}: {planes.shape[1]} planes; expected {self.camera.stored_planes} of "
                f"{self.camera.name}"
            )
        return planes

    @property
    def names(self) -> tuple[str, ...]:
        """Numbers of the frames."""
        return numbered(len(self._planes))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns of a frame."""
        _, planes, height, width = self._planes.shape
        return planes, height, width

    def read(self, start: int, stop: int) -> StoredFrames:
        """Frames `start` to `stop`."""
        told = {name: self._numbers(name, start, stop) for name in PER_FRAME}
        gray = self._arrays.get("gray")
        if gray is not None:
            gray = gray[None] if gray.ndim == 2 else gray
            expected = (len(self._planes), *self.shape[1:])
            if gray.shape != expected:
                raise ValueError(f"{self.path}: gray has shape {gray.shape}; expected {expected}")
            gray = gray[start:stop]
        told_hz = self._arrays.get("frequencies_hz")
        frequencies = None if told_hz is None else tuple(map(float, np.ravel(told_hz)))
        return StoredFrames(
            np.array(self._planes[start:stop]),
            gray,
            frequencies_hz=frequencies,
            saturated=self._saturated(start, stop),
            **told,
        )

    def _saturated(self, start: int, stop: int) -> np.ndarray | None:
        """Flags [F, P, H, W], where there are some."""
        flags = self._arrays.get("saturated")
        if flags is None:
            return None
        planes, axes = self._planes, self._axes
        alone = (len(planes), *planes.shape[2:])
        if flags.dtype == np.bool_ and flags.shape == self._arrays["dcs"].shape:
            return _in_order(flags, axes)[start:stop]
        if flags.dtype != np.bool_ or flags.shape != alone:
            raise ValueError(
                f"{self.path}: saturated is {flags.dtype} {flags.shape}; expected bool, as dcs or "
                f"{alone}"
            )
        return np.broadcast_to(flags[:, None], planes.shape)[start:stop]

    def _numbers(self, name: str, start: int, stop: int) -> tuple[float, ...] | None:
        """One number a frame, or one for all."""
        array = self._arrays.get(name)
        if array is None:
            return None
        frames = len(self._planes)
        if array.dtype.kind not in "iuf" or array.shape not in ((), (frames,)):
            raise ValueError(
                f"{self.path}: {name} is {array.dtype} {array.shape}; expected one number, or "
                f"{frames}, one for each frame"
            )
        return tuple(map(float, np.broadcast_to(array, frames)[start:stop]))


def _in_order(array: np.ndarray, axes: str) -> np.ndarray:
    """[F, P, H, W], a view of an array with these axes."""
    ordered = array.transpose([axes.index(letter) for letter in "FPHW" if letter in axes])
    return ordered if "F" in axes else ordered[None]


def _mapped(path: Path) -> np.ndarray:
    """The array of an `.npy` file, mapped: pages are read as they are looked at."""
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            header = read_npy_header(file)
            following = size - file.tell()
            if header.dtype.hasobject:
                raise ValueError("holds pickled objects, which are never read")
            if header.nbytes != following or any(length < 1 for length in header.shape):
                raise ValueError(
                    f"its header promises {header.dtype} {header.shape}, {header.nbytes} bytes; "
                    f"{following} bytes follow"
                )
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except BROKEN as error:
        raise ValueError(f"{path}: {in_one_line(error)}") from None
