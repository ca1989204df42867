"""A recording from wherever it lies: one file, a folder of images, maps in files of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from unwrap.recordings.images import read_folder, read_gray16
from unwrap.recordings.recording import (
    ARRAYS,
    Recording,
    read_recording,
    with_gray,
    with_offset,
)
from unwrap.signal import ADC_BITS, Shots
from unwrap.support import read_arrays


def load_recording(
    path: Path,
    *,
    bits: int = ADC_BITS,
    gray: Path | None = None,
    offset: Path | None = None,
    unwrapped: bool = True,
) -> Recording:
    """Recording of a file or a folder, complete enough to be unwrapped.

    Parameters
    ----------
    path : Path
        `.npy`, `.npz`, or a folder of PNG files; see `read_recording` and `read_folder`.
    bits : int
        Of the converter.
    gray : Path, optional
        Gray images, in place of those of the recording: `.npy`, `.npz` or a 16-bit `.png`.
    offset : Path, optional
        Dark-offset map, in place of the recording's: `.npy` or `.npz`.
    unwrapped : bool
        Whether a network is to unwrap it; the wrapped distance needs no gray image,
        and a dark scene has none.

    Raises
    ------
    ValueError
        What `read_recording` or `read_folder` refuses, or 2 or 4 samples without gray images.
    """
    recording = (read_folder if path.is_dir() else read_recording)(path, bits=bits)
    if gray is not None:
        recording = with_gray(recording, read_map(gray, "gray"), str(gray), bits=bits)
    if offset is not None:
        recording = with_stored_offset(recording, offset)
    if unwrapped:
        require_gray(recording, str(path))
    return recording


def require_gray(recording: Recording, where: str) -> None:
    """Check that there are gray images where there are too few samples to do without.

    Raises
    ------
    ValueError
        There are none; the message begins with `where`.
    """
    shots = recording.raw.shots
    # Eight samples tell the wrap by their two frequencies; fewer need a network, which needs gray.
    if recording.gray is None and shots != Shots.EIGHT:
        raise ValueError(
            f"{where}: {int(shots)} samples and no gray image; expected gray images beside them, "
            "in the recording or with --gray, or 8 samples, or --unwrapper none for the wrapped "
            "distance"
        )


def with_stored_offset(recording: Recording, path: Path) -> Recording:
    """`recording` with the dark-offset map of an `.npy` or `.npz` file."""
    return with_offset(recording, read_map(path, "offset_lsb"), str(path))


def read_map(path: Path, name: str) -> np.ndarray:
    """The array `name` of a file; the only one in an `.npy` file or an image.

    Raises
    ------
    ValueError
        The file is missing, damaged, too large or of another kind, or has no such array.
    """
    if path.suffix == ".png":
        return read_gray16(path)
    arrays = read_arrays(path, name, ARRAYS)
    if name not in arrays:
        raise ValueError(f"{path}: {name} is missing")
    return arrays[name]
