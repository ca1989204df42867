"""Kinect v2 logs in HDF5: `Frame_0/Ir`, `Frame_1/Ir`, ... with the bytes that the camera sends.

A frame is ten images of 424 x 512 words of 11 bits: three phases at each of three frequencies, and
one that is not used. Rows begin in the middle of the image, columns are woven by four, and words
are companded: small values as they are, large ones in steps of up to 64 (as libfreenect2 reads
them).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from unwrap.cameras.files.camera_description import CameraDescription
from unwrap.cameras.files.hdf5_files import opened_hdf5
from unwrap.cameras.files.stored_frames import StoredFrames

HEIGHT, WIDTH, IMAGES = 424, 512, 10
ROW_BYTES = WIDTH * 11 // 8
IMAGE_BYTES = HEIGHT * ROW_BYTES
SATURATED = 32767


@dataclass(frozen=True)
class KinectLog:
    """Frames of a log.

    Attributes
    ----------
    path : Path
    camera : CameraDescription
    """

    path: Path
    camera: CameraDescription

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the groups, in the order of their numbers."""
        with opened_hdf5(self.path) as file:
            numbers = {
                int(name[6:]) for name in file if name[:6] == "Frame_" and name[6:].isdigit()
            }
            if not numbers:
                raise ValueError(f"no group Frame_0; it has {', '.join(file) or 'nothing'}")
            missing = sorted(set(range(min(numbers), max(numbers) + 1)) - numbers)
            if missing:
                raise ValueError(f"frame Frame_{missing[0]} is missing between others")
        return tuple(f"Frame_{number}" for number in sorted(numbers))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Planes, rows and columns of a frame."""
        return self.camera.planes, HEIGHT, WIDTH

    def read(self, start: int, stop: int) -> StoredFrames:
        """Frames `start` to `stop`."""
        frames = []
        with opened_hdf5(self.path) as file:
            for name in self.names[start:stop]:
                if "Ir" not in file[name]:
                    raise ValueError(f"frame {name}: Ir is missing")
                content = file[name]["Ir"]
                if content.size != IMAGES * IMAGE_BYTES or content.dtype.itemsize != 1:
                    raise ValueError(
                        f"frame {name}: Ir is {content.dtype} of {content.size}; expected "
                        f"{IMAGES * IMAGE_BYTES} bytes"
                    )
                frames.append(decode_packet(content[()].reshape(-1).view(np.uint8))[:-1])
        return StoredFrames(np.stack(frames))


def expanded() -> np.ndarray:
    """Value int16 of each word: its highest bit is the sign, steps double every 128 words."""
    steps = [1 << max(word // 128 - 1, 0) for word in range(1023)]
    values = np.concatenate(([0], np.cumsum(steps))).astype(np.int16)
    table = np.concatenate((values, -values))
    table[1024] = SATURATED  # A zero with a sign is free to say that the pixel was full.
    return table


def decode_packet(content: np.ndarray) -> np.ndarray:
    """Images int16 [10, 424, 512] of the bytes uint8 of a frame.

    The first and the last column are not there: zero.
    """
    rows = content.reshape(IMAGES, HEIGHT, ROW_BYTES)
    bits = np.unpackbits(rows, axis=-1, bitorder="little").reshape(IMAGES, HEIGHT, WIDTH, 11)
    words = np.zeros(bits.shape[:-1], np.uint16)
    for place in range(11):  # One bit of all words at a time, which takes least memory.
        words |= bits[..., place].astype(np.uint16) << place
    stored_row, stored_column = stored_places()
    images = expanded()[words[:, stored_row][..., stored_column]]
    images[..., [0, -1]] = 0
    return images


def stored_places() -> tuple[np.ndarray, np.ndarray]:
    """Row [424] and column [512] of the stored image where each of the image's lies."""
    row, column = np.arange(HEIGHT), np.arange(WIDTH)
    half = HEIGHT // 2
    return np.where(row < half, row + half, HEIGHT - 1 - row), (column >> 2) + ((column & 3) << 7)
