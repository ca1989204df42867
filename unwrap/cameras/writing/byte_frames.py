"""Files of bytes alone, frame after frame: wire frames, packed RAW12 and dumps of numbers."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from unwrap.cameras.files import CELSIUS_K, WIRE_HEADER, CameraDescription, StoredFrames

WIRE_VERSION = 3
"""What the header tells first; no reader here asks for it."""


def write_wire(file: BinaryIO, stored: StoredFrames, camera: CameraDescription) -> None:
    """Frames as an epc660 camera sends them, each after its gray image where there is one.

    Times are rounded to microseconds and temperatures to hundredths of a degree, as its header
    holds them.

    Raises
    ------
    ValueError
        Temperature or integration time are missing, or more than the header can hold.
    """
    told = {"temperature_k": stored.temperature_k, "integration_s": stored.integration_s}
    for name, values in told.items():
        if values is None:
            raise ValueError(f"{name} is missing; {camera.name} stores one with each frame")
    temperatures, times = told["temperature_k"], told["integration_s"]
    assert temperatures is not None and times is not None
    layout, (_, _, height, width) = camera.layout, stored.planes.shape
    assert layout.height is not None and layout.width is not None
    if height > layout.height or width > layout.width:
        raise ValueError(
            f"images are {height} x {width}; expected at most {layout.height} x {layout.width}, "
            f"the chip of {camera.name}"
        )
    for frame, planes in enumerate(stored.planes):
        low_us = round(times[frame] * 1e6)
        centi = round(100 * (temperatures[frame] - CELSIUS_K))
        if not (0 < low_us < 2**16 and -(2**15) <= centi < 2**15):
            raise ValueError(
                f"frame {frame} has integration_s {times[frame]:g} and temperature_k "
                f"{temperatures[frame]:g}; expected 1 us to 65 ms and -54 to 600 K"
            )

        def header(kind: int | None, low_us: int = low_us, centi: int = centi) -> bytes:
            region = 0, 0, width, height
            told = low_us, 0, 0, centi, WIRE_HEADER.size
            return WIRE_HEADER.pack(WIRE_VERSION, kind, width, height, *region, *told)

        if stored.gray is not None:
            file.write(header(layout.gray_type) + stored.gray[frame].astype("<u2").tobytes())
        file.write(header(layout.dcs_type) + planes.astype("<u2").tobytes())


def write_raw12(file: BinaryIO, stored: StoredFrames, camera: CameraDescription) -> None:
    """Packed words, rows padded and each frequency followed by zeros as described."""
    layout, planes = camera.layout, stored.planes
    _require_size(planes, camera)
    assert layout.row_bytes is not None
    trailer = bytes(layout.trailer_rows * layout.row_bytes + layout.trailer_bytes)
    per_frequency = len(camera.samples.phase_deg)
    for group in planes.reshape(-1, per_frequency, *planes.shape[2:]):
        packed = pack_raw12(group)
        padding = [(0, 0), (0, 0), (0, layout.row_bytes - packed.shape[-1])]
        file.write(np.pad(packed, padding).tobytes() + trailer)


def pack_raw12(words: np.ndarray) -> np.ndarray:
    """Bytes [..., 3 n] of words [..., 2 n], of which the low twelve bits are kept.

    Examples
    --------
    >>> [hex(byte) for byte in pack_raw12(np.array([0x123, 0x456]))]
    ['0x12', '0x45', '0x63']
    """
    first, second = words[..., 0::2], words[..., 1::2]
    low = (second & 15) << 4 | first & 15
    triples = np.stack((first >> 4 & 255, second >> 4 & 255, low), axis=-1).astype(np.uint8)
    return triples.reshape(*words.shape[:-1], -1)


def write_dump(file: BinaryIO, stored: StoredFrames, camera: CameraDescription) -> None:
    """Numbers of the described format and order of axes.

    Raises
    ------
    ValueError
        Another size than described, or a number that the format does not hold.
    """
    layout, planes = camera.layout, stored.planes
    _require_size(planes, camera)
    assert layout.axes is not None and layout.dtype is not None
    dtype = np.dtype(layout.dtype)
    if dtype.kind != "f":
        low, high = int(planes.min()), int(planes.max())
        limits = np.iinfo(dtype)
        if planes.dtype.kind == "f" or low < limits.min or high > limits.max:
            raise ValueError(
                f"numbers are {planes.dtype} from {low} to {high}; expected what {layout.dtype} "
                f"of {camera.name} holds"
            )
    letters = layout.axes.replace("F", "")
    frames = planes.transpose(["FPHW".index(letter) for letter in "F" + letters])
    file.write(frames.astype(dtype).tobytes())


def _require_size(planes: np.ndarray, camera: CameraDescription) -> None:
    expected = camera.layout.height, camera.layout.width
    if planes.shape[2:] != expected:
        raise ValueError(
            f"images are {planes.shape[2]} x {planes.shape[3]}; expected {expected[0]} x "
            f"{expected[1]}, as {camera.name} has them: describe a camera of that size"
        )
