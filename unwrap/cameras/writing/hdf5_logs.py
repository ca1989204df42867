"""HDF5 files: those of ESPROS's software, and logs of a Kinect v2."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, BinaryIO

import numpy as np

from unwrap.cameras.files import (
    FRAMES,
    GRAY,
    IMAGE_BYTES,
    IMAGES,
    SAMPLES,
    SATURATED,
    TIMES,
    CameraDescription,
    StoredFrames,
    expanded,
    stored_places,
)


@contextmanager
def hdf5_in(file: BinaryIO) -> Iterator[Any]:
    """An HDF5 file to fill, written into `file` at the end.

    Raises
    ------
    ImportError
        h5py is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise ImportError(
            "writing HDF5 needs h5py, which is not installed; pip install 'shotenv[cameras]'"
        ) from None
    content = io.BytesIO()
    with h5py.File(content, "w") as opened:
        yield opened
    file.write(content.getbuffer())


def write_espros(file: BinaryIO, stored: StoredFrames, camera: CameraDescription) -> None:
    """Samples of one frequency, with its megahertz and the times of the frames."""
    assert stored.frequencies_hz is not None
    (frequency_hz,) = stored.frequencies_hz
    _write_images(
        file, stored.planes, SAMPLES, stored.timestamp_s, mod_frequency=frequency_hz / 1e6
    )


def write_espros_gray(file: BinaryIO, stored: StoredFrames) -> None:
    """The gray images, a file of their own."""
    assert stored.gray is not None
    _write_images(file, stored.gray, GRAY, stored.timestamp_s)


def _write_images(
    file: BinaryIO,
    images: np.ndarray,
    image_type: str,
    times_s: tuple[float, ...] | None,
    **attributes: float,
) -> None:
    height, width = images.shape[-2:]
    with hdf5_in(file) as opened:
        opened.attrs["image_type"] = image_type
        opened.attrs["roi"] = (0, 0, width, height)
        for name, value in attributes.items():
            opened.attrs[name] = value
        opened[FRAMES] = images.astype(np.int32)
        if times_s is not None:
            opened[TIMES] = times_s


def write_kinect(file: BinaryIO, stored: StoredFrames, camera: CameraDescription) -> None:
    """Nine images a frame, each number as the nearest that a word of eleven bits stands for.

    Raises
    ------
    ValueError
        Another number or size of images than the camera has.
    """
    row, column = stored_places()
    expected = IMAGES - 1, len(row), len(column)
    if stored.planes.shape[1:] != expected:
        raise ValueError(
            f"planes of a frame are {stored.planes.shape[1:]}; expected {expected}, as a log of "
            f"{camera.name} has them"
        )
    with hdf5_in(file) as opened:
        for number, planes in enumerate(stored.planes):
            words = np.zeros((IMAGES, *expected[1:]), np.uint16)
            words[:-1, row[:, None], column] = companded(planes)
            opened[f"Frame_{number}/Ir"] = _bits(words)


def companded(values: np.ndarray) -> np.ndarray:
    """Words of eleven bits, uint16, that stand for the numbers nearest to `values`.

    What is larger than any is full.
    """
    table = expanded()
    positive = table[:1024].astype(np.int64)
    size = np.abs(values.astype(np.int64))
    code = np.searchsorted((positive[1:] + positive[:-1]) / 2, size, side="right")
    full = (size > positive[-1]) | (values == SATURATED)
    # Word 1024, a zero with a sign, is that of a full pixel.
    words = np.where((values < 0) & (code > 0), code + 1024, code)
    return np.where(full, 1024, words).astype(np.uint16)


def _bits(words: np.ndarray) -> np.ndarray:
    """Bytes uint8 of the words of all images, eleven bits each, the lowest first."""
    bits = np.empty((*words.shape, 11), np.uint8)
    for place in range(11):
        bits[..., place] = words >> place & 1
    content = np.packbits(bits.reshape(IMAGES, -1), axis=-1, bitorder="little")
    assert content.shape == (IMAGES, IMAGE_BYTES)  # A row is whole bytes: 512 x 11 / 8.
    return content.reshape(-1)
