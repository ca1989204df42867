"""Pictures of a frame: gray, wrapped map, corrected depth, truth and error side by side."""

from __future__ import annotations

import numpy as np
import torch
from PIL import Image, ImageDraw
from torch import Tensor

from shotenv.decision import Problem, State, acquire_depth, derated_w
from shotenv.sensor import full_scale_lsb
from unwrap.signal import Shots, unambiguous_range_m

PANELS = ("gray", "wrapped", "corrected", "truth", "error")
CAPTION_PX = 14
GAP_PX = 2
ERROR_TOP_M = 2.0
# Anchors of the viridis colour map (CC0), evenly spaced.
_ANCHORS = np.array(
    [
        (68, 1, 84),
        (71, 45, 123),
        (59, 82, 139),
        (44, 114, 142),
        (33, 145, 140),
        (40, 174, 128),
        (94, 201, 98),
        (173, 220, 48),
        (253, 231, 37),
    ],
    dtype=np.float64,
)


def draw_frame(problem: Problem, state: State, shots: int) -> np.ndarray:
    """Picture uint8 [h, w, 3] of the frame at `state` (a batch of one), taken with `shots`.

    0 shots draws what there is without laser: the gray image and the truth. Noise belongs to the
    drive and the frame, so the picture shows exactly what the step saw.
    """
    panels = frame_panels(problem, state, shots)
    temperature_c = float(state.laser.temperature_k) - 273.15
    laser = f"{shots} DCS" if shots else "no laser"
    caption = f"frame {int(state.step)}   {laser}   {temperature_c:.1f} C"
    return _framed([panels[name] for name in PANELS], caption)


def frame_panels(problem: Problem, state: State, shots: int) -> dict[str, np.ndarray]:
    """The pictures of a frame by name, each uint8 [H, W, 3]; black where there is nothing."""
    sensor, drive = problem.config.sensor, state.drive
    frame = drive.frame(state.step)
    gray = problem.bank.gray(frame)[0].to(torch.float32) / full_scale_lsb(sensor.adc_bits)
    truth_m = problem.bank.exposure(frame).distance_m[0]
    near_m = torch.where(truth_m <= sensor.max_range_m, truth_m, torch.nan)
    black = torch.full_like(truth_m, torch.nan)
    wrapped_m, corrected_m, error_m = black, black, black
    if shots:
        made = acquire_depth(problem, drive, state.step, Shots(shots), derated_w(problem, state))
        wrapped_m = made.depth.wrapped_m[0]
        corrected_m = torch.where(made.depth.valid[0], made.depth.distance_m[0], torch.nan)
        error_m = torch.where(made.scored[0], (corrected_m - truth_m).abs(), torch.nan)
    return {
        "gray": grayscale(gray),
        "wrapped": colours(wrapped_m, unambiguous_range_m(sensor.f1_hz)),
        "corrected": colours(corrected_m, sensor.max_range_m),
        "truth": colours(near_m, sensor.max_range_m),
        "error": colours(error_m, ERROR_TOP_M),
    }


def grayscale(values: Tensor) -> np.ndarray:
    """Gray picture uint8 [H, W, 3] of values in 0..1; square root brightens the shadows."""
    level = (255 * values.clamp(0, 1).sqrt()).round().to(torch.uint8).numpy()
    return np.repeat(level[:, :, None], 3, axis=2)


def colours(values: Tensor, top: float) -> np.ndarray:
    """False-colour picture uint8 [H, W, 3] of values in 0..top; black where not finite."""
    array = values.numpy().astype(np.float64)
    known = np.isfinite(array)
    place = np.clip(np.where(known, array, 0.0) / top, 0.0, 1.0) * (len(_ANCHORS) - 1)
    low = np.minimum(place.astype(int), len(_ANCHORS) - 2)
    part = (place - low)[:, :, None]
    mixed = _ANCHORS[low] * (1 - part) + _ANCHORS[low + 1] * part
    return np.where(known[:, :, None], mixed.round(), 0).astype(np.uint8)


def _framed(panels: list[np.ndarray], caption: str) -> np.ndarray:
    height, width, _ = panels[0].shape
    across = len(panels) * (width + GAP_PX) - GAP_PX
    sheet = Image.new("RGB", (across, height + 2 * CAPTION_PX))
    pen = ImageDraw.Draw(sheet)
    for place, (name, panel) in enumerate(zip(PANELS, panels, strict=True)):
        left = place * (width + GAP_PX)
        sheet.paste(Image.fromarray(panel), (left, CAPTION_PX))
        pen.text((left + 2, 1), name, fill=(200, 200, 200))
    pen.text((2, CAPTION_PX + height + 1), caption, fill=(200, 200, 200))
    return np.asarray(sheet).copy()
