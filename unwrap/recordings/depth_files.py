"""What is written of a corrected frame: maps, an image in millimetres, points, a picture."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import numpy as np
from PIL import Image
from torch import Tensor

from unwrap.depth import points_of
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
from unwrap.recordings.images import HIGHEST_MM, depth_png
from unwrap.recordings.recording import Recording
from unwrap.signal import DepthFrame, SensorDescription, unambiguous_range_m

FILES = ("depth_m.npy", "valid.npy", "depth_mm.png", "points.ply", "picture.png")
TILE_PX = 320


@dataclass(frozen=True)
class Corrected:
    """One frame, a batch of one: its recording, its depth, and the network's confidence."""

    recording: Recording
    depth: DepthFrame
    confidence: Tensor | None


def contents(
    frame: Corrected, sensor: SensorDescription, horizontal_fov_deg: float
) -> dict[str, bytes]:
    """Files of one frame by name, see `FILES`."""
    depth_m, valid = frame.depth.distance_m[0].numpy(), frame.depth.valid[0].numpy()
    picture = io.BytesIO()
    draw(frame, sensor).save(picture, format="PNG")
    made = (
        _npy(depth_m.astype(np.float32)),
        _npy(valid),
        depth_png(depth_m, valid),
        point_cloud(frame, horizontal_fov_deg),
        picture.getvalue(),
    )
    return dict(zip(FILES, made, strict=True))


def _npy(array: np.ndarray) -> bytes:
    content = io.BytesIO()
    np.save(content, array, allow_pickle=False)
    return content.getvalue()


def numbers_of(frame: Corrected) -> dict[str, float | int]:
    """Shares of valid and saturated pixels, median distance, pixels beyond what a PNG holds."""
    distances = frame.depth.distance_m[frame.depth.valid]
    return {
        "valid_share": frame.depth.valid.double().mean().item(),
        "saturated_share": frame.recording.raw.saturated.double().mean().item(),
        "median_m": distances.median().item(),
        "pixels_beyond_png": int((distances * 1000 > HIGHEST_MM).sum()),
    }


def point_cloud(frame: Corrected, horizontal_fov_deg: float) -> bytes:
    """Binary little-endian PLY of the valid pixels: metres ahead, left and up, gray as colour."""
    import trimesh

    valid, width = frame.depth.valid[0], frame.depth.valid.shape[-1]
    focal = width / 2 / math.tan(math.radians(horizontal_fov_deg) / 2)
    points = points_of(frame.depth.distance_m.double(), focal)[:, 0, valid].T
    colors = None
    if frame.recording.gray is not None:
        level = (frame.recording.gray[0][valid] * 255).round().byte().numpy()
        colors = np.stack([level, level, level, np.full_like(level, 255)], axis=-1)
    return trimesh.PointCloud(points.numpy(), colors=colors).export(file_type="ply")


def draw(frame: Corrected, sensor: SensorDescription) -> Image.Image:
    """Gray image (without: amplitude), wrapped map, depth and confidence, side by side."""
    valid = frame.depth.valid[0].numpy()
    depth_m = np.where(valid, frame.depth.distance_m[0].numpy(), np.nan)
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    panels = [
        _passive(frame),
        (
            "wrapped distance",
            frame.depth.wrapped_m[0].numpy(),
            ColorMap(0.0, unambiguous_m, f"m, at {sensor.f1_hz / 1e6:g} MHz", CYCLIC),
        ),
        ("distance", depth_m, ColorMap(0.0, sensor.max_range_m, "m; light gray: none", VIRIDIS)),
        _trust(frame, valid),
    ]
    words = f"{int(frame.recording.raw.shots)} DCS   {100 * valid.mean():.1f} % valid"
    tiles = [_panel(*panel) for panel in panels]
    return framed(column([text(words, SMALL_PX), line(tiles, gap=MARGIN_PX)]))


def _passive(frame: Corrected) -> tuple[str, np.ndarray, ColorMap]:
    if frame.recording.gray is not None:
        colors = ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY)
        return "gray image", frame.recording.gray[0].numpy() ** 0.5, colors
    amplitude = frame.depth.amplitude[0].clamp(min=1.0).log10().numpy()
    return "amplitude", amplitude, ColorMap(0.0, 3.3, "log10, LSB", ERROR)


def _trust(frame: Corrected, valid: np.ndarray) -> tuple[str, np.ndarray, ColorMap]:
    if frame.confidence is None:
        return "validity", valid.astype(float), ColorMap(0.0, 1.0, "1 = valid", GRAY)
    shown = np.where(valid, frame.confidence[0].numpy(), np.nan)
    colors = ColorMap(0.0, 1.0, "of the network; light gray: invalid", VIRIDIS)
    return "confidence", shown, colors


def _panel(name: str, values: np.ndarray, colors: ColorMap) -> Image.Image:
    tile = enlarged(paint(values, colors), TILE_PX)
    return column([tile, bar(name, colors, tile.width, max(1, tile.width // (2 * TILE_PX)))])
