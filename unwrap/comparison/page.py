"""The results table as a page, as numbers, and as pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from shotenv.dataset import SensedFrames
from unwrap.depth import correct_sensed
from unwrap.networks import Unwrapper
from unwrap.pictures import (
    CYCLIC,
    ERROR,
    FAINT,
    GRAY,
    LARGE_PX,
    SMALL_PX,
    VIRIDIS,
    ColorMap,
    bar,
    column,
    enlarged,
    framed,
    line,
    paint,
    text,
)
from unwrap.signal import Shots, unambiguous_range_m, wrapped_distance_m
from unwrap.training import JUDGED_DRAW

Row = dict[str, Any]
COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("rmse_m", "RMSE m", ".2f"),
    ("mae_m", "MAE m", ".2f"),
    ("irmse_per_km", "iRMSE 1/km", ".1f"),
    ("sq_rel_kitti", "SqRel (KITTI)", ".3f"),
    ("sq_rel_eigen", "SqRel (Eigen)", ".3f"),
    ("abs_rel", "AbsRel", ".3f"),
    ("silog", "SILog", ".1f"),
    ("accuracy_percent", "acc. %", ".2f"),
    ("precision_percent", "prec. %", ".2f"),
    ("wrap_accuracy", "right wrap", ".4f"),
    ("p95_m", "p95 m", ".2f"),
    ("class_accuracy", "class acc.", ".3f"),
    ("class_precision", "class prec.", ".3f"),
    ("calibration_error", "ECE", ".3f"),
)
"""Key of a row, head of its column, format."""

PUBLISHED = """\
| DCS | network | RMSE | iRMSE | SqRel | AbsRel | pred. acc., prec. % | corr. acc., prec. % |
|---|---|---|---|---|---|---|---|
| 4 | TofRegNet | 2.02 | 4.3342 | 0.6032 | 0.6084 | 98.66, 99.27 | 94.39, 99.06 |
| 4 | TofSegNet | 2.01 | 4.3134 | 0.6028 | 0.5969 | 99.56, 99.99 | 94.44, 99.08 |
| 2 | TofRegNet | 1.81 | 4.2654 | 0.4974 | 0.5692 | 98.66, 99.27 | 94.93, 98.63 |
| 2 | TofSegNet | 1.78 | 4.2447 | 0.4878 | 0.5530 | 99.61, 99.99 | 95.05, 98.64 |
"""
"""As printed by Nagiub et al. (2023), of their own recordings."""


def tables(rows: Sequence[Row]) -> str:
    """Markdown: a table for each split and truth, in the order in which they come."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["split"], row["truth"]), []).append(row)
    return "\n".join(
        f"### Split by {split}, {truth} truth\n\n{_table(of)}"
        if split in ("clip", "frame")
        else f"### Held-out families, {truth} truth\n\n{_table(of)}"
        for (split, truth), of in groups.items()
    )


def _table(rows: Iterable[Row]) -> str:
    heads = ("DCS", "method", "merge", *(head for _, head, _ in COLUMNS))
    lines = [_cells(heads), _cells(["---"] * len(heads))]
    for row in sorted(rows, key=lambda row: row["shots"]):
        numbers = [_number(row.get(key), form) for key, _, form in COLUMNS]
        lines.append(_cells([str(row["shots"]), row["method"], row["merge"], *numbers]))
    return "\n".join(lines) + "\n"


def _cells(values: Iterable[str]) -> str:
    return "| " + " | ".join(values) + " |"


def _number(value: float | None, form: str) -> str:
    return "" if value is None else format(value, form)


def figure(
    networks: dict[str, Unwrapper], frames: SensedFrames, numbers: Sequence[int]
) -> Image.Image:
    """Some frames: gray, truth, each network's prediction, wrapped and corrected maps of 4 DCS.

    `networks` are by name; a confidence is shown of the last of them.
    """
    unambiguous_m = unambiguous_range_m(frames.sensor.f1_hz)
    maps = {
        "gray": ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY),
        "distance": ColorMap(0.0, frames.sensor.max_range_m, "m, clipped above", VIRIDIS),
        "wrapped": ColorMap(0.0, unambiguous_m, "m", CYCLIC),
        "confidence": ColorMap(0.0, 1.0, "", ERROR),
    }
    rows = [_row(networks, frames, number, maps) for number in numbers]
    width = rows[0].width // len(maps) - 16
    legend = line([bar(name, colors, width, 1) for name, colors in maps.items()], gap=16)
    return framed(column([*rows, legend], gap=10))


@torch.inference_mode()
def _row(
    networks: dict[str, Unwrapper], frames: SensedFrames, number: int, maps: dict[str, ColorMap]
) -> Image.Image:
    sensed, truth = frames.batch([number], draw=JUDGED_DRAW, shots=Shots.FOUR)
    tiles = [
        _tile("gray image", sensed.gray.sqrt(), maps["gray"]),
        _tile("truth", truth.distance_m, maps["distance"]),
        _tile("wrapped, 4 DCS", wrapped_distance_m(sensed, frames.sensor), maps["wrapped"]),
    ]
    for name, network in networks.items():
        found = network.predict_sensed(sensed, frames.sensor)
        tiles.append(_tile(name, found.distance_m, maps["distance"]))
        if network.network.needs == "gray":
            depth = correct_sensed(sensed, found.distance_m, frames.sensor)
            tiles.append(_tile("corrected", depth.distance_m, maps["distance"]))
    tiles.append(_tile(f"confidence of {name}", found.confidence, maps["confidence"]))
    return column([text(frames.families[number].replace("_", " "), LARGE_PX), line(tiles)])


def _tile(name: str, values: Tensor, colors: ColorMap) -> Image.Image:
    image = enlarged(paint(np.asarray(values[0].float()), colors))
    return column([text(name, SMALL_PX, FAINT), image])
