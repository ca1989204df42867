"""A recording of a described camera: opened once, read piece by piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from unwrap.cameras.camera_frames import CameraFrames, as_tensor
from unwrap.cameras.canonical import canonical, in_order
from unwrap.cameras.files import (
    GRAY,
    ArrayFrames,
    AxesConfig,
    BinaryFrames,
    CameraDescription,
    EsprosFile,
    FrameSource,
    KinectLog,
    StoredFrames,
    WireFrames,
)
from unwrap.cameras.stored_words import gray_of, samples_of
from unwrap.recordings import read_map

PIECE_BYTES = 1 << 26
"""Samples of a piece, as float32: what is made of them takes several times as much."""
LARGEST_FRAME_BYTES = 1 << 28
READERS: dict[str, Callable[[Path, CameraDescription], FrameSource]] = {
    "espros_hdf5": EsprosFile,
    "espros_wire": WireFrames,
    "arrays": ArrayFrames,
    "packed_raw12": BinaryFrames,
    "dump": BinaryFrames,
    "kinect_hdf5": KinectLog,
}
"""Reader of each container."""
BESIDE = ("temperature_k", "integration_s", "laser_power_w", "timestamp_s")
"""What is told of each frame beside its maps."""


@dataclass(frozen=True)
class CameraRecording:
    """Frames in a file, or a folder, that are read piece by piece.

    Attributes
    ----------
    source : FrameSource
    camera : CameraDescription
    gray_file : FrameSource, array [F, H, W] or None
        Passive images from a file of their own.
    """

    source: FrameSource
    camera: CameraDescription
    gray_file: FrameSource | np.ndarray | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the frames."""
        return self.source.names

    @property
    def size(self) -> tuple[int, int]:
        """Rows and columns of a frame as it is delivered."""
        _, height, width = self.source.shape
        return (width, height) if self.camera.axes.transpose else (height, width)

    def pieces(self) -> Iterator[CameraFrames]:
        """All frames, as many at a time as `PIECE_BYTES` of samples hold.

        Raises
        ------
        ValueError
            What is damaged, outside the described range or at odds with the description, when it
            is come to; the message names file and frame.
        """
        count = max(1, PIECE_BYTES // (4 * int(np.prod(self.source.shape))))
        for start in range(0, len(self.names), count):
            yield self.read(start, min(start + count, len(self.names)))

    def read(self, start: int, stop: int) -> CameraFrames:
        """Frames `start` to `stop`; see `pieces` for what is refused."""
        camera, where = self.camera, str(self.source.path)
        stored, names = self._without_gray_plane(start, stop), self.names[start:stop]
        samples, saturated = samples_of(stored.planes, camera, where, names)
        if stored.saturated is not None:
            saturated = saturated | stored.saturated
        frequencies = self._frequencies(stored)
        by_frequency = samples.reshape(len(names), len(frequencies), -1, *samples.shape[2:])
        ordered, made = canonical(by_frequency, camera.samples)
        full = in_order(saturated.reshape(by_frequency.shape), camera.samples)
        descending = sorted(range(len(frequencies)), key=lambda k: -frequencies[k])
        gray = self._gray(stored, start, stop)
        return CameraFrames(
            as_tensor(turned(ordered[:, descending], camera.axes)),
            as_tensor(turned(np.any(saturated, axis=1), camera.axes)),
            None if gray is None else as_tensor(turned(gray, camera.axes)),
            tuple(frequencies[k] for k in descending),
            made,
            names,
            saturated_samples=as_tensor(turned(full[:, descending], camera.axes)),
            **{name: self._told(stored, name, names) for name in BESIDE},
        )

    def _without_gray_plane(self, start: int, stop: int) -> StoredFrames:
        """Frames as stored, where a plane is the gray image with that apart."""
        stored, passive = self.source.read(start, stop), self.camera.passive
        if passive.where == "plane" and passive.plane is not None:
            gray = stored.planes[:, passive.plane]
            flags = stored.saturated
            return replace(
                stored,
                planes=np.delete(stored.planes, passive.plane, 1),
                saturated=None if flags is None else np.delete(flags, passive.plane, 1),
                gray=gray,
            )
        if stored.gray is not None and passive.where != "recording":
            raise ValueError(
                f"{self.source.path}: gray images are in the recording; expected none, as "
                f"passive.where of {self.camera.name} is {passive.where!r}"
            )
        return stored

    def _frequencies(self, stored: StoredFrames) -> tuple[float, ...]:
        """Frequencies in the order of the planes, from the file where it tells them."""
        told, camera = stored.frequencies_hz, self.camera
        if told is None:
            return camera.frequencies_hz
        allowed = sorted({*camera.selectable_hz, *camera.frequencies_hz}, reverse=True)
        # As described, to the last bit: files may tell megahertz.
        found = tuple(known for hz in told for known in allowed if abs(hz - known) < 1.0)
        if len(found) != len(told) or len(told) != len(camera.frequencies_hz):
            raise ValueError(
                f"{self.source.path}: modulation frequencies are {', '.join(map(_mhz, told))}; "
                f"expected {len(camera.frequencies_hz)} of {', '.join(map(_mhz, allowed))}, as "
                f"{camera.name} has them"
            )
        return found

    def _gray(self, stored: StoredFrames, start: int, stop: int) -> np.ndarray | None:
        """Passive images [F, H, W] in 0..1, from a file of their own or from the recording."""
        where, gray = str(self.source.path), stored.gray
        if isinstance(self.gray_file, np.ndarray):
            gray = self.gray_file[start:stop]
        elif self.gray_file is not None:
            where = str(self.gray_file.path)
            gray = self.gray_file.read(start, stop).planes[:, 0]
        if gray is None:
            return None
        return gray_of(gray, self.camera, where, self.names[start:stop])

    def _told(
        self, stored: StoredFrames, name: str, names: tuple[str, ...]
    ) -> tuple[float, ...] | None:
        """One number a frame, from the file or else from the description."""
        values = getattr(stored, name)
        if values is None:
            constant = getattr(self.camera.constants, name, None)
            return None if constant is None else (constant,) * len(names)
        for frame, value in zip(names, values, strict=True):
            # NaN compares false. Of times only their differences matter.
            if not (value > 0 if name != "timestamp_s" else abs(value) < 1e300):
                raise ValueError(
                    f"{self.source.path}: frame {frame} has a {name} of {value}; expected a "
                    f"{'finite' if name == 'timestamp_s' else 'positive'} number"
                )
        return values


def open_camera_recording(
    path: Path, camera: CameraDescription, *, gray: Path | None = None
) -> CameraRecording:
    """The recording in a file or a folder of the described camera.

    Parameters
    ----------
    gray : Path, optional
        Passive images, in place of those in the recording: `.npy`, `.npz`, 16-bit `.png`, or a
        file of gray images as the camera writes them.

    Raises
    ------
    ImportError
        A package that reads this kind of file is not installed.
    ValueError
        The file is missing, damaged, or not as described; the message names it.
    """
    if camera.container == "simulation":
        raise ValueError(
            f"{path}: {camera.name} is described for simulation; its samples are not to be had"
        )
    source = READERS[camera.container](path, camera)
    if 4 * int(np.prod(source.shape)) > LARGEST_FRAME_BYTES:
        raise ValueError(
            f"{path}: a frame of {source.shape} samples is larger than "
            f"{LARGEST_FRAME_BYTES >> 20} MiB"
        )
    return CameraRecording(source, camera, None if gray is None else _gray_file(gray, source))


def _gray_file(path: Path, source: FrameSource) -> FrameSource | np.ndarray:
    """Passive images of a file of their own, one for each frame."""
    images: FrameSource | np.ndarray
    if path.suffix in (".h5", ".hdf5") and isinstance(source, EsprosFile):
        images = EsprosFile(path, source.camera, GRAY)
        found = (len(images.names), *images.shape[1:])
    else:
        array = read_map(path, "gray")
        images = array[None] if array.ndim == 2 else array
        found = images.shape
    expected = (len(source.names), *source.shape[1:])
    if found != expected:
        raise ValueError(
            f"{path}: gray images are {found}; expected {expected}, as {source.path} has"
        )
    return images


def turned(maps: np.ndarray, axes: AxesConfig) -> np.ndarray:
    """Maps [..., H, W] as they lie in the view."""
    swapped = maps.swapaxes(-1, -2) if axes.transpose else maps
    rows = slice(None, None, -1 if axes.flip_rows else 1)
    columns = slice(None, None, -1 if axes.flip_columns else 1)
    return swapped[..., rows, columns]


def _mhz(frequency_hz: float) -> str:
    return f"{frequency_hz / 1e6:g} MHz"
