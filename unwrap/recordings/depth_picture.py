"""A corrected frame as one picture: what was seen, the wrapped map, depth and how sure it is."""

from __future__ import annotations

import numpy as np
from PIL import Image

from unwrap.pictures import (
    CYCLIC,
    ERROR,
    GRAY,
    MARGIN_PX,
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
from unwrap.recordings.frame_correction import CorrectedFrame
from unwrap.signal import SensorDescription, unambiguous_range_m

TILE_PX = 320
LOG10_FULL_LSB = 3.3
"""Brightest amplitude shown without a gray image: half a 12-bit converter's range is 10^3.3 LSB."""


def draw_frame(frame: CorrectedFrame, sensor: SensorDescription) -> Image.Image:
    """Gray image (without: amplitude), wrapped map, depth and confidence, side by side."""
    valid = frame.depth.valid[0].numpy()
    depth_m = np.where(valid, frame.depth.distance_m[0].numpy(), np.nan)
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    panels = [
        _seen(frame),
        (
            "wrapped distance",
            frame.depth.wrapped_m[0].numpy(),
            ColorMap(0.0, unambiguous_m, f"m, at {sensor.f1_hz / 1e6:g} MHz", CYCLIC),
        ),
        ("distance", depth_m, ColorMap(0.0, sensor.max_range_m, "m; light gray: none", VIRIDIS)),
        _sureness(frame, valid),
    ]
    tiles = []
    for name, values, colors in panels:
        tile = enlarged(paint(values, colors), TILE_PX)
        # Frames that are shown larger than `TILE_PX` get larger words.
        legend = bar(name, colors, tile.width, max(1, tile.width // (2 * TILE_PX)))
        tiles.append(column([tile, legend]))
    words = f"{int(frame.recording.raw.shots)} DCS   {100 * valid.mean():.1f} % valid"
    return framed(column([text(words, SMALL_PX), line(tiles, gap=MARGIN_PX)]))


def _seen(frame: CorrectedFrame) -> tuple[str, np.ndarray, ColorMap]:
    """The gray image, or the amplitude where there is none."""
    if frame.recording.gray is not None:
        colors = ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY)
        return "gray image", frame.recording.gray[0].numpy() ** 0.5, colors
    amplitude = frame.depth.amplitude[0].clamp(min=1.0).log10().numpy()
    return "amplitude", amplitude, ColorMap(0.0, LOG10_FULL_LSB, "log10, LSB", ERROR)


def _sureness(frame: CorrectedFrame, valid: np.ndarray) -> tuple[str, np.ndarray, ColorMap]:
    """The network's confidence, or where depth is valid if no network was asked."""
    if frame.confidence is None:
        return "validity", valid.astype(float), ColorMap(0.0, 1.0, "1 = valid", GRAY)
    shown = np.where(valid, frame.confidence[0].numpy(), np.nan)
    colors = ColorMap(0.0, 1.0, "of the network; light gray: invalid", VIRIDIS)
    return "confidence", shown, colors
