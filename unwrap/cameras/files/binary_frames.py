"""Files of bytes alone, frame after frame: packed RAW12 and dumps of numbers.

Such files tell nothing of themselves. What is checked is their length: it must be that of whole
frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from unwrap.cameras.files.camera_description import CameraDescription
from unwrap.cameras.files.stored_frames import StoredFrames, numbered
from unwrap.support import in_one_line


@dataclass(frozen=True)
class BinaryFrames:
    """Frames of one length, in one file or in the files of a folder in the order of their names.

    Attributes
    ----------
    path : Path
    camera : CameraDescription
        Of container "packed_raw12" or "dump".
    """

    path: Path
    camera: CameraDescription

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns of a frame."""
        height, width = self.camera.layout.height, self.camera.layout.width
        assert height is not None and width is not None  # The description has seen to it.
        return self.camera.stored_planes, height, width

    @property
    def frame_bytes(self) -> int:
        """Bytes of a frame, everything between its planes included."""
        planes, height, width = self.shape
        layout = self.camera.layout
        if self.camera.container == "dump":
            return planes * height * width * np.dtype(layout.dtype).itemsize
        return len(self.camera.frequencies_hz) * _group_bytes(self.camera)

    @cached_property
    def places(self) -> tuple[tuple[Path, int], ...]:
        """File and first byte of each frame.

        Raises
        ------
        ValueError
            No file, or one that does not end with a frame.
        """
        found = []
        for file in self._files():
            whole, rest = divmod(file.stat().st_size, self.frame_bytes)
            if rest:
                raise ValueError(
                    f"{file}: frame {whole} has {rest} bytes; expected {self.frame_bytes} in each "
                    f"frame of {self.camera.name}: the file is cut off, or padded otherwise"
                )
            found += [(file, number * self.frame_bytes) for number in range(whole)]
        if not found:
            raise ValueError(f"{self.path}: empty; expected frames of {self.frame_bytes} bytes")
        return tuple(found)

    def _files(self) -> list[Path]:
        if not self.path.is_dir():
            if not self.path.is_file():
                raise ValueError(f"{self.path}: no such file")
            return [self.path]
        return sorted(path for path in self.path.iterdir() if path.is_file())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the files where each holds one frame, else numbers."""
        stems = [file.stem for file, _ in self.places]
        alone = self.path.is_dir() and len(set(stems)) == len(stems)
        return tuple(stems) if alone else numbered(len(stems))

    def read(self, start: int, stop: int) -> StoredFrames:
        """Frames `start` to `stop`."""
        frames = []
        for number in range(start, stop):
            file, first = self.places[number]
            try:
                with file.open("rb") as opened:
                    opened.seek(first)
                    content = opened.read(self.frame_bytes)
            except OSError as error:
                raise ValueError(f"{file}: {in_one_line(error)}") from None
            if len(content) < self.frame_bytes:
                raise ValueError(f"{file}: frame {self.names[number]} is cut off")
            frames.append(self._planes(content))
        return StoredFrames(np.stack(frames))

    def _planes(self, content: bytes) -> np.ndarray:
        """Planes [P, H, W] of the bytes of a frame."""
        layout, (planes, height, width) = self.camera.layout, self.shape
        if self.camera.container == "packed_raw12":
            groups = np.frombuffer(content, np.uint8).reshape(-1, _group_bytes(self.camera))
            assert layout.row_bytes is not None
            rows = groups[:, : -_trailer_bytes(self.camera) or None]
            rows = rows.reshape(planes, height, layout.row_bytes)
            return unpack_raw12(rows[..., : width // 2 * 3])
        assert layout.axes is not None
        letters = layout.axes.replace("F", "")
        sizes = {"P": planes, "H": height, "W": width}
        array = np.frombuffer(content, layout.dtype).reshape([sizes[letter] for letter in letters])
        return array.transpose([letters.index(letter) for letter in "PHW"])


def unpack_raw12(packed: np.ndarray) -> np.ndarray:
    """Words uint16 [..., 2 n] of bytes [..., 3 n]: p0 = b0 << 4 | b2 & 15, p1 = b1 << 4 | b2 >> 4.

    Examples
    --------
    >>> [hex(word) for word in unpack_raw12(np.array([0x12, 0x45, 0x63], np.uint8))]
    ['0x123', '0x456']
    """
    words = packed.reshape(*packed.shape[:-1], -1, 3).astype(np.uint16)
    first, second, low = words[..., 0], words[..., 1], words[..., 2]
    pairs = np.stack((first << 4 | low & 15, second << 4 | low >> 4), axis=-1)
    return pairs.reshape(*packed.shape[:-1], -1)


def _trailer_bytes(camera: CameraDescription) -> int:
    """Bytes after the planes of a frequency."""
    layout = camera.layout
    assert layout.row_bytes is not None
    return layout.trailer_rows * layout.row_bytes + layout.trailer_bytes


def _group_bytes(camera: CameraDescription) -> int:
    """Bytes of the planes of a frequency, and of what follows them."""
    layout = camera.layout
    assert layout.row_bytes is not None and layout.height is not None
    planes = len(camera.samples.phase_deg) * layout.height * layout.row_bytes
    return planes + _trailer_bytes(camera)
