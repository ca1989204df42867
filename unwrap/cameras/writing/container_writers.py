"""A writer for each container, and what it tells beside the planes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from unwrap.cameras.files import PER_FRAME, CameraDescription, StoredFrames
from unwrap.cameras.writing.byte_frames import write_dump, write_raw12, write_wire
from unwrap.cameras.writing.hdf5_logs import write_espros, write_kinect
from unwrap.support import MAX_BYTES


@dataclass(frozen=True)
class Container:
    """How recordings of a kind are written.

    Attributes
    ----------
    suffix : str
        Of the file.
    write : callable
        Writes frames into an open file.
    tells : frozenset of str
        What the file holds beside planes; "gray" where images may be among them.
    """

    suffix: str
    write: Callable[[BinaryIO, StoredFrames, CameraDescription], None]
    tells: frozenset[str] = frozenset()


def write_arrays(file: BinaryIO, stored: StoredFrames, camera: CameraDescription) -> None:
    """An `.npz` file with all that is known, axes as described.

    Raises
    ------
    ValueError
        Several frames, where the axes have none of frames; more than is read again.
    """
    axes, planes = camera.layout.axes, stored.planes
    assert axes is not None  # The description has seen to it.
    if "F" not in axes and len(planes) > 1:
        raise ValueError(
            f"{len(planes)} frames; expected one, as layout.axes of {camera.name} is {axes!r}"
        )

    def lying(maps: np.ndarray) -> np.ndarray:
        turned = maps.transpose(["FPHW".index(letter) for letter in ("F" + axes.replace("F", ""))])
        return np.moveaxis(turned, 0, axes.index("F")) if "F" in axes else turned[0]

    arrays: dict[str, Any] = {"dcs": lying(planes)}
    if stored.gray is not None:
        arrays["gray"] = stored.gray
    if stored.saturated is not None and stored.saturated.any():
        arrays["saturated"] = lying(stored.saturated)
    for name in ("frequencies_hz", *PER_FRAME):
        value = getattr(stored, name)
        if value is not None:
            arrays[name] = np.array(value, np.float64)
    if (size := sum(array.nbytes for array in arrays.values())) > MAX_BYTES:
        raise ValueError(
            f"{len(planes)} frames are {size >> 20} MiB of arrays; expected at most "
            f"{MAX_BYTES >> 20}, which are read again: record fewer frames at a time"
        )
    np.savez_compressed(file, **arrays)


CONTAINERS = {
    "arrays": Container(
        ".npz", write_arrays, frozenset({"gray", "saturated", "frequencies_hz", *PER_FRAME})
    ),
    "espros_hdf5": Container(".h5", write_espros, frozenset({"frequencies_hz", "timestamp_s"})),
    "espros_wire": Container(
        ".bin", write_wire, frozenset({"gray", "temperature_k", "integration_s"})
    ),
    "packed_raw12": Container(".raw", write_raw12),
    "dump": Container(".raw", write_dump, frozenset({"gray"})),
    "kinect_hdf5": Container(".h5", write_kinect),
}
