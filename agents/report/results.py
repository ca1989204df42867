"""Results of an evaluation as they lie on disk beside the report.

results.json    means and intervals of every policy, paired differences, seeds, versions
drives.csv      one row per policy and drive
choices.json    what the scheduler asked for, over pairs of what it observed
timeline.json   one drive, frame by frame, of the scheduler, of always 8 DCS and of the optimum
frames.npz      images of some of its frames: gray, wrapped map, corrected depth, truth; none of a
                thinned bank, which has no images
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from unwrap.support import (
    in_one_line,
    read_arrays,
    read_json as read_table,
    write_bytes,
    write_text,
)

CURE = "`shotenv evaluate` writes it"
TODAY = "always_8"
"""What a sensor without a scheduler does, and the answer compares with."""
OPTIMUM = "optimum"
"""Dynamic programming, which knows what every choice would bring."""
RESULTS, DRIVES, CHOICES = "results.json", "drives.csv", "choices.json"
TIMELINE, FRAMES = "timeline.json", "frames.npz"
GRAY_GAMMA = 0.5  # assumed: a linear image is too dark to look at
# Policies without a line here are shown by their names, without underscores.
LABELS = {
    "snr_threshold": "SNR threshold rule",
    "snr_two_thresholds": "Two SNR thresholds",
    "blind": "Best mixture of fixed choices",
    "optimum": "Optimum, knows all",
    "always_2": "Always 2 DCS",
    "always_4": "Always 4 DCS",
    "always_8": "Always 8 DCS",
}


@dataclass(frozen=True)
class Strip:
    """Frames to look at. F frames of H x W pixels.

    Attributes
    ----------
    gray_lsb : uint16 [F, H, W]
        Passive gray image, 12 bits.
    wrapped_m, corrected_m, truth_m : float32 [F, H, W]
        Wrapped distance at f1, depth after unwrapping, true distance; metres, NaN where there
        is none.
    valid : bool [F, H, W]
        Where the sensor calls its depth valid.
    shots, frame : int64 [F]
        Samples taken (0: the laser was off) and the frame's number in its drive.
    depth_mae_m : float64 [F]
        Mean absolute depth error, NaN where there is none.
    temperature_k, laser_energy_j : float64 [F]
        Of the laser after the frame, and its energy in the drive so far.
    optimum_shots, optimum_energy_j : int64 [F], float64 [F]
        Samples that the optimum takes of this frame and its energy so far; empty [0] where it is
        not known.
    family, drive : str [F], int64 [F]
        Scene family and seed of the drive.
    unambiguous_m, max_range_m : float
        Unambiguous range at f1 and largest scored range, metres.
    """

    gray_lsb: np.ndarray
    wrapped_m: np.ndarray
    corrected_m: np.ndarray
    truth_m: np.ndarray
    valid: np.ndarray
    shots: np.ndarray
    frame: np.ndarray
    depth_mae_m: np.ndarray
    temperature_k: np.ndarray
    laser_energy_j: np.ndarray
    optimum_shots: np.ndarray
    optimum_energy_j: np.ndarray
    family: np.ndarray
    drive: np.ndarray
    unambiguous_m: np.ndarray
    max_range_m: np.ndarray


def label(name: str) -> str:
    """A policy's name as it is shown."""
    # Not `capitalize`, which would make "dcs" of "DCS".
    return LABELS.get(name, name[:1].upper() + name[1:].replace("_", " "))


def in_a_sentence(name: str) -> str:
    """The same within a sentence."""
    # Labels begin with a capital; abbreviations keep theirs.
    return label(name).lower().replace("dcs", "DCS").replace("snr", "SNR")


def write_drives(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """One line per policy and drive, as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue())


def write_strip(path: Path, strip: Strip) -> None:
    """Images and their labels as a compressed numpy archive."""
    content = io.BytesIO()
    np.savez_compressed(content, **vars(strip))
    write_bytes(path, content.getvalue())


def read_strip(path: Path) -> Strip:
    """Strip written by `write_strip`.

    Raises
    ------
    ValueError
        The file is missing or damaged.
    """
    try:
        strip = Strip(**read_arrays(path, "", [field.name for field in fields(Strip)]))
        _check_strip(strip)
    except (ValueError, TypeError) as error:  # the latter where arrays are missing
        raise ValueError(f"{path} is missing or damaged ({error}); {CURE}") from None
    return strip


def _check_strip(strip: Strip) -> None:
    """Raise ValueError unless arrays have the types and shapes that `Strip` tells."""
    frames, *size = strip.gray_lsb.shape
    maps = dict.fromkeys(("wrapped_m", "corrected_m", "truth_m"), "f")
    rows = dict.fromkeys(("depth_mae_m", "temperature_k", "laser_energy_j"), "f")
    of_optimum = {"optimum_shots": "i", "optimum_energy_j": "f"}
    kinds = (
        ({"gray_lsb": "u", "valid": "b"} | maps, [(frames, *size)]),
        ({"shots": "i", "frame": "i", "family": "U", "drive": "iu"} | rows, [(frames,)]),
        (of_optimum, [(0,), (frames,)]),
        ({"unambiguous_m": "f", "max_range_m": "f"}, [()]),
    )
    for names, shapes in kinds:
        for name, kind in names.items():
            array = getattr(strip, name)
            if array.dtype.kind not in kind or array.shape not in shapes or len(size) != 2:
                raise ValueError(f"{name} is {array.dtype} {array.shape}")


def read_json(path: Path) -> dict[str, Any]:
    """A table that an evaluation wrote.

    Raises
    ------
    ValueError
        The file is missing or damaged.
    """
    try:
        return read_table(path)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} is missing or damaged ({in_one_line(error)}); {CURE}") from None
