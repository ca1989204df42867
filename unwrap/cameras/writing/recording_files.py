"""A recording as files: the inverse of `unwrap.cameras.open_camera_recording`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from unwrap.cameras import CameraFrames
from unwrap.cameras.files import CameraDescription
from unwrap.cameras.writing.container_writers import CONTAINERS, Container
from unwrap.cameras.writing.hdf5_logs import write_espros_gray
from unwrap.cameras.writing.stored_planes import stored_frames
from unwrap.support import replacing


@dataclass(frozen=True)
class WrittenFiles:
    """Files of a recording.

    Attributes
    ----------
    recording : Path
    gray : Path or None
        Passive images, where they are a file of their own.
    """

    recording: Path
    gray: Path | None


def write_camera_recording(
    folder: Path, name: str, frames: CameraFrames, camera: CameraDescription
) -> WrittenFiles:
    """Write frames as a recording of the described camera.

    Of gray images that it does not hold a second file is written, as `--gray` takes it.

    Parameters
    ----------
    folder, name
        Where, and the files' name without its ending.

    Raises
    ------
    ValueError
        The camera cannot hold the frames, or a file is there already.
    """
    container = container_of(camera)
    stored = stored_frames(
        frames,
        camera,
        tells_frequencies="frequencies_hz" in container.tells,
        tells_saturation="saturated" in container.tells,
    )
    path = _new(folder / f"{name}{container.suffix}")
    inside = camera.passive.where in ("recording", "plane") and "gray" in container.tells
    own = None
    gray = stored.gray
    if gray is not None and not inside:
        own = _new(folder / f"{name}_gray{'.h5' if camera.container == 'espros_hdf5' else '.npy'}")
    with replacing(path) as file:
        container.write(file, stored if inside else replace(stored, gray=None), camera)
    if own is not None and gray is not None:
        with replacing(own) as file:
            if camera.container == "espros_hdf5":
                write_espros_gray(file, stored)
            else:
                np.save(file, gray, allow_pickle=False)
    return WrittenFiles(path, own)


def container_of(camera: CameraDescription) -> Container:
    """How recordings of the camera are written.

    Raises
    ------
    ValueError
        Its samples are not to be had.
    """
    if camera.container not in CONTAINERS:
        raise ValueError(
            f"{camera.name} is described for simulation; it has no recordings that could be written"
        )
    return CONTAINERS[camera.container]


def _new(path: Path) -> Path:
    if path.exists():
        raise ValueError(f"{path} is there already; nothing is written over")
    return path
