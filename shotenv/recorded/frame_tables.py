"""What is told of a recording in files of their own: reference, speeds and exposures, offsets."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from unwrap.recordings import read_map
from unwrap.support import open_regular, read_arrays

EGO_COLUMNS = ("ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
LARGEST_TABLE_BYTES = 1 << 24


def read_truth(path: Path, shape: tuple[int, int, int]) -> np.ndarray:
    """Reference float32 [F, H, W] of an `.npy` file, metres; NaN where there is none.

    Raises
    ------
    ValueError
        The file is missing or damaged, of another shape, or holds distances that are not positive.
    """
    truth = read_arrays(path, "distance_m", ("distance_m",)).get("distance_m")
    if truth is None or truth.shape != shape or truth.dtype.kind != "f":
        found = "nothing" if truth is None else f"{truth.dtype} {truth.shape}"
        raise ValueError(f"{path}: truth is {found}; expected floats {shape}, as the recording has")
    wrong = truth <= 0
    if wrong.any():
        frame, row, column = (int(i) for i in np.argwhere(wrong)[0])
        raise ValueError(
            f"{path}: frame {frame} holds {truth[frame, row, column]:g} m at row {row}, column "
            f"{column}; expected positive distances, NaN where there is no reference"
        )
    # Sky, for example: no distance is no reference.
    return np.where(np.isfinite(truth), truth, np.nan).astype(np.float32)


def read_offset(path: Path, shape: tuple[int, int]) -> np.ndarray:
    """Calibrated dark offset float32 [H, W], LSB.

    Raises
    ------
    ValueError
        The file is missing or damaged, of another shape, or not finite.
    """
    offset = read_map(path, "offset_lsb")
    if offset.shape != shape or offset.dtype.kind not in "if" or not np.isfinite(offset).all():
        raise ValueError(
            f"{path}: offset is {offset.dtype} {offset.shape}; expected finite numbers {shape}"
        )
    return offset.astype(np.float32)


def read_ego(path: Path, frames: int) -> dict[str, tuple[float, ...]]:
    """Columns of a table of speeds, yaw rates and exposures, one number for each frame.

    Columns that are not there are left out.

    Raises
    ------
    ValueError
        The file is missing or too large, a column unknown, a value no number, or another number of
        rows than frames; the message names file and row.
    """
    try:
        with open_regular(path, LARGEST_TABLE_BYTES) as file:
            table = csv.DictReader(io.TextIOWrapper(file, encoding="utf-8", newline=""))
            rows, names = list(table), table.fieldnames or ()
    except (OSError, ValueError, csv.Error) as error:
        raise ValueError(f"{path}: no table of ego motion ({error})") from None
    if unknown := [name for name in names if name not in EGO_COLUMNS]:
        raise ValueError(f"{path}: column {unknown[0]!r}; expected some of {EGO_COLUMNS}")
    if len(rows) != frames:
        raise ValueError(f"{path}: {len(rows)} rows; expected {frames}, one for each frame")
    return {name: _column(path, name, [row[name] for row in rows]) for name in names}


def _column(path: Path, name: str, texts: list[str | None]) -> tuple[float, ...]:
    values = []
    for number, text in enumerate(texts):
        try:
            value = float(text or "")
        except ValueError:
            value = np.nan
        sound = np.isfinite(value) and (value > 0 or name != "gray_exposure_s")
        if not sound:
            wanted = "a positive" if name == "gray_exposure_s" else "a finite"
            raise ValueError(
                f"{path}: {name} of frame {number} is {text!r}; expected {wanted} number"
            )
        values.append(value)
    return tuple(values)
