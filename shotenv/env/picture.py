"""Pictures of a frame: gray, wrapped map, corrected depth, truth and error side by side."""

from __future__ import annotations

import numpy as np
import torch
from PIL import Image, ImageDraw

from shotenv.decision import Problem, State, acquire_depth
from shotenv.laser import emitted_power_w
from shotenv.sensor import full_scale_lsb
from unwrap.pictures import GRAY, VIRIDIS, ColorMap, paint
from unwrap.signal import Shots, unambiguous_range_m

PANELS = ("gray", "wrapped", "corrected", "truth", "error")
CAPTION_PX = 14
GAP_PX = 2
ERROR_TOP_M = 2.0
INK, BLACK = (200, 200, 200), (0, 0, 0)


def paint_frame(problem: Problem, state: State, shots: int) -> np.ndarray:
    """Picture uint8 [h, w, 3] of the frame at `state` (a batch of one), taken with `shots`.

    0 shots paints what there is without laser: the gray image and the truth. Noise belongs to the
    drive and the frame, so the picture shows exactly what the step saw.
    """
    panels = frame_panels(problem, state, shots)
    laser = f"{shots} DCS" if shots else "no laser"
    temperature_c = float(state.laser.temperature_k) - 273.15
    width, height = panels["gray"].size
    across = len(PANELS) * (width + GAP_PX) - GAP_PX
    sheet = Image.new("RGB", (across, height + 2 * CAPTION_PX))
    pen = ImageDraw.Draw(sheet)
    for place, name in enumerate(PANELS):
        left = place * (width + GAP_PX)
        sheet.paste(panels[name], (left, CAPTION_PX))
        pen.text((left + 2, 1), name, fill=INK)
    caption = f"frame {int(state.step)}   {laser}   {temperature_c:.1f} C"
    pen.text((2, CAPTION_PX + height + 1), caption, fill=INK)
    # A copy, because an image lends its memory for reading alone.
    return np.asarray(sheet).copy()


def frame_panels(problem: Problem, state: State, shots: int) -> dict[str, Image.Image]:
    """The pictures of a frame by name, each W x H pixels; black where there is nothing."""
    sensor, drive = problem.config.sensor, state.drive
    frame = drive.frame(state.step)
    gray = problem.bank.gray(frame)[0].to(torch.float32) / full_scale_lsb(sensor.adc_bits)
    truth_m = problem.bank.exposure(frame).distance_m[0]
    # What is beyond the scored range stays black, like the sky; its error would not count.
    near_m = torch.where(truth_m <= sensor.max_range_m, truth_m, torch.nan)
    nothing = torch.full_like(truth_m, torch.nan)
    wrapped_m, corrected_m, error_m = nothing, nothing, nothing
    if shots:
        power_w = emitted_power_w(
            drive.laser_power_w, state.laser.temperature_k, problem.config.laser
        )
        acquisition = acquire_depth(problem, drive, state.step, Shots(shots), power_w)
        depth = acquisition.depth
        wrapped_m = depth.wrapped_m[0]
        corrected_m = torch.where(depth.valid[0], depth.distance_m[0], torch.nan)
        error_m = torch.where(acquisition.scored[0], (corrected_m - truth_m).abs(), torch.nan)
    distance = ColorMap(0.0, sensor.max_range_m, "m", VIRIDIS, BLACK)
    wrapped = ColorMap(0.0, unambiguous_range_m(sensor.f1_hz), "m", VIRIDIS, BLACK)
    maps = {
        # The square root brightens the shadows.
        "gray": (gray.sqrt(), ColorMap(0.0, 1.0, "full scale", GRAY, BLACK)),
        "wrapped": (wrapped_m, wrapped),
        "corrected": (corrected_m, distance),
        "truth": (near_m, distance),
        "error": (error_m, ColorMap(0.0, ERROR_TOP_M, "m", VIRIDIS, BLACK)),
    }
    return {name: paint(values.numpy(), colors) for name, (values, colors) in maps.items()}
