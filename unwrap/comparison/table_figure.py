"""The figure of the results table: frames, and what networks make of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from unwrap.comparison.compared_frames import ComparedFrames
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

LEGEND_GAP_PX, ROW_GAP_PX = 16, 10


def draw_frames(
    networks: Mapping[str, Unwrapper], frames: ComparedFrames, numbers: Sequence[int]
) -> Image.Image:
    """Some frames: gray, truth, each network's prediction, wrapped and corrected maps of 4 DCS.

    Parameters
    ----------
    networks : mapping of str to Unwrapper
        By name, at least one; a confidence is shown of the last of them.
    frames : ComparedFrames
    numbers : sequence of int
        Frames that are shown, a row each.
    """
    unambiguous_m = unambiguous_range_m(frames.sensor.f1_hz)
    maps = {
        "gray": ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY),
        "distance": ColorMap(0.0, frames.sensor.max_range_m, "m, clipped above", VIRIDIS),
        "wrapped": ColorMap(0.0, unambiguous_m, "m", CYCLIC),
        "confidence": ColorMap(0.0, 1.0, "", ERROR),
    }
    rows = [_frame_row(networks, frames, number, maps) for number in numbers]
    width = rows[0].width // len(maps) - LEGEND_GAP_PX
    bars = [bar(name, colors, width, 1) for name, colors in maps.items()]
    return framed(column([*rows, line(bars, gap=LEGEND_GAP_PX)], gap=ROW_GAP_PX))


@torch.inference_mode()
def _frame_row(
    networks: Mapping[str, Unwrapper],
    frames: ComparedFrames,
    number: int,
    maps: Mapping[str, ColorMap],
) -> Image.Image:
    """One frame as a row of tiles, under the name of its family."""
    sensed, truth = frames.batch([number], draw=JUDGED_DRAW, shots=Shots.FOUR)
    tiles = [
        # Gamma 0.5, or night scenes would be black.
        _tile("gray image", sensed.gray.sqrt(), maps["gray"]),
        _tile("truth", truth.distance_m, maps["distance"]),
        _tile("wrapped, 4 DCS", wrapped_distance_m(sensed, frames.sensor), maps["wrapped"]),
    ]
    for name, network in networks.items():
        found = network.predict_sensed(sensed, frames.sensor)
        tiles.append(_tile(name, found.distance_m, maps["distance"]))
        # Networks of the samples have refined the measured distance themselves.
        if network.network.needs == "gray":
            depth = correct_sensed(sensed, found.distance_m, frames.sensor)
            tiles.append(_tile("corrected", depth.distance_m, maps["distance"]))
    tiles.append(_tile(f"confidence of {name}", found.confidence, maps["confidence"]))
    return column([text(frames.families[number].replace("_", " "), LARGE_PX), line(tiles)])


def _tile(name: str, values: Tensor, colors: ColorMap) -> Image.Image:
    image = enlarged(paint(np.asarray(values[0].float()), colors))
    return column([text(name, SMALL_PX, FAINT), image])
