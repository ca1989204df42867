"""Pictures of a drive: its last frame in panels, and below them what it has cost so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont

from shotenv.decision import Problem, State
from shotenv.env.image_observation import acquired_again
from shotenv.sensor import full_scale_lsb
from unwrap.pictures import GRAY, VIRIDIS, ColorMap, enlarged, paint
from unwrap.signal import Shots, unambiguous_range_m

PANELS = ("gray", "wrapped", "corrected", "truth", "error")
PANEL_PX = 160
"""Least width of a panel: smaller images are enlarged by a whole factor."""
CAPTION_PX, GAP_PX, LANE_PX, FONT_PX = 16, 4, 44, 11
ERROR_TOP_M = 2.0
INK, FAINT, BLACK = (215, 215, 215), (110, 110, 110), (0, 0, 0)
SHOTS_COLORS = {2: (86, 180, 233), 4: (240, 228, 66), 8: (230, 120, 30), 0: (150, 0, 0)}
"""Colours that stay apart for colour-blind eyes, too; 0 is a frame without laser."""
ZERO_C_K = 273.15


@dataclass(frozen=True)
class Trace:
    """A drive (a batch of one) so far.

    Attributes
    ----------
    state : State
        Before the last frame; at the start of the drive that of its first.
    shots : tuple of int
        Samples of each frame played; 0 without laser.
    temperature_k : tuple of float
        Laser temperature before the first frame and after each.
    laser_energy_j : tuple of float
        Laser energy of each frame.
    """

    state: State
    shots: tuple[int, ...]
    temperature_k: tuple[float, ...]
    laser_energy_j: tuple[float, ...]

    @classmethod
    def start(cls, state: State) -> Trace:
        """Nothing has been played yet."""
        return cls(state, (), (float(state.laser.temperature_k),), ())

    def after(
        self, before: State, shots: int, temperature_k: float, laser_energy_j: float
    ) -> Trace:
        """One frame later, which was played from `before`."""
        return Trace(
            before,
            (*self.shots, shots),
            (*self.temperature_k, temperature_k),
            (*self.laser_energy_j, laser_energy_j),
        )


def paint_drive(problem: Problem, trace: Trace) -> np.ndarray:
    """Picture uint8 [h, w, 3] of a drive's last frame and of the drive so far.

    Before the first frame, and of one without laser, there are the gray image and the truth alone.
    Noise belongs to the drive and the frame, so the picture shows exactly what the step saw.
    """
    shots = trace.shots[-1] if trace.shots else 0
    panels = [
        (name, enlarged(image, PANEL_PX))
        for name, image in frame_panels(problem, trace.state, shots).items()
    ]
    width, height = panels[0][1].size
    across = len(panels) * (width + GAP_PX) - GAP_PX
    lanes = paint_lanes(problem, trace, across)
    sheet = Image.new("RGB", (across, 2 * CAPTION_PX + height + lanes.height), BLACK)
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(FONT_PX)
    units = ("", f" (0 to {wrap_m(problem):.2f} m)", *(2 * [f" (0 to {range_m(problem):g} m)"]))
    for place, (name, image) in enumerate(panels):
        left = place * (width + GAP_PX)
        sheet.paste(image, (left, CAPTION_PX))
        unit = (*units, f" (0 to {ERROR_TOP_M:g} m)")[place]
        pen.text((left + 2, 2), name + unit, INK, font)
    taken = f"{shots} DCS" if shots else "no laser" if trace.shots else "not taken yet"
    caption = (
        f"frame {int(trace.state.step)} of {problem.config.frames_per_drive}   {taken}   "
        f"{trace.temperature_k[-1] - ZERO_C_K:.1f} C   {sum(trace.laser_energy_j):.3f} J laser"
    )
    pen.text((2, CAPTION_PX + height + 2), caption, INK, font)
    sheet.paste(lanes, (0, 2 * CAPTION_PX + height))
    # A copy, because an image lends its memory for reading alone.
    return np.asarray(sheet).copy()


def wrap_m(problem: Problem) -> float:
    """Unambiguous range of the samples that 2 and 4 DCS take, m."""
    return unambiguous_range_m(problem.config.sensor.f1_hz)


def range_m(problem: Problem) -> float:
    """Scored range, m."""
    return problem.config.sensor.max_range_m


def frame_panels(problem: Problem, state: State, shots: int) -> dict[str, Image.Image]:
    """The pictures of a frame by name, each W x H pixels; black where there is nothing."""
    frame = state.drive.frame(state.step)
    full_scale = full_scale_lsb(problem.config.sensor.adc_bits)
    gray = problem.bank.gray(frame)[0].to(torch.float32) / full_scale
    acquisition = acquired_again(problem, state, Shots(shots)) if shots else None
    # Where it is measured itself it comes with the acquisition.
    truth_m = (acquisition.truth_m if acquisition else problem.bank.distance_m(frame))[0]
    # What is beyond the scored range stays black, like the sky; its error would not count.
    near_m = torch.where(truth_m <= range_m(problem), truth_m, torch.nan)
    nothing = torch.full_like(truth_m, torch.nan)
    wrapped_m, corrected_m, error_m = nothing, nothing, nothing
    if acquisition:
        depth = acquisition.depth
        wrapped_m = depth.wrapped_m[0]
        corrected_m = torch.where(depth.valid[0], depth.distance_m[0], torch.nan)
        error_m = torch.where(acquisition.scored[0], (corrected_m - truth_m).abs(), torch.nan)
    distance = ColorMap(0.0, range_m(problem), "m", VIRIDIS, BLACK)
    wrapped = ColorMap(0.0, wrap_m(problem), "m", VIRIDIS, BLACK)
    maps = {
        # The square root brightens the shadows.
        "gray": (gray.sqrt(), ColorMap(0.0, 1.0, "full scale", GRAY, BLACK)),
        "wrapped": (wrapped_m, wrapped),
        "corrected": (corrected_m, distance),
        "truth": (near_m, distance),
        "error": (error_m, ColorMap(0.0, ERROR_TOP_M, "m", VIRIDIS, BLACK)),
    }
    return {name: paint(values.numpy(), colors) for name, (values, colors) in maps.items()}


def paint_lanes(problem: Problem, trace: Trace, width: int) -> Image.Image:
    """Shots, temperature and energy over the frames of the drive, one lane below the other."""
    frames, laser, drive = problem.config.frames_per_drive, problem.config.laser, trace.state.drive
    image = Image.new("RGB", (width, 3 * (LANE_PX + GAP_PX)), BLACK)
    pen, font = ImageDraw.Draw(image), ImageFont.load_default(FONT_PX)
    left = 110
    across = width - left - GAP_PX

    def x(frame: float) -> float:
        return left + across * frame / frames

    def lane(place: int, name: str, low: float, high: float):
        """Height of a value in the lane, whose name and axis are drawn."""
        top = place * (LANE_PX + GAP_PX) + GAP_PX
        pen.text((2, top + LANE_PX // 2 - FONT_PX // 2), name, INK, font)
        pen.rectangle((left, top, width - GAP_PX, top + LANE_PX - 1), outline=(50, 50, 50))
        return lambda value: top + (LANE_PX - 1) * (1.0 - (value - low) / (high - low))

    y = lane(0, "shots", 0.0, float(Shots.EIGHT))
    for place, (shots, color) in enumerate(SHOTS_COLORS.items()):
        pen.text((44 + 14 * place, y(4.0) - FONT_PX // 2), str(shots or "off"), color, font)
    for frame, shots in enumerate(trace.shots):
        # A frame without laser is as high as two samples, so that it is seen.
        height = shots or 2
        box = (x(frame), y(height), max(x(frame + 1) - 1, x(frame)), y(0))
        pen.rectangle(box, fill=SHOTS_COLORS[shots])

    ambient_k = float(drive.ambient_k)
    y = lane(1, "temperature", ambient_k - 1.0, laser.trip_k + 2.0)
    for name, limit_k in (("trip", laser.trip_k), ("ambient", ambient_k)):
        pen.line((left, y(limit_k), width - GAP_PX, y(limit_k)), fill=FAINT)
        words = f"{name} {limit_k - ZERO_C_K:.0f} C"
        # Between the two lines, and not on them.
        down, anchor = (2, "la") if name == "trip" else (-3, "ls")
        pen.text((left + 4, y(limit_k) + down), words, FAINT, font, anchor)
    points = [(x(frame), y(k)) for frame, k in enumerate(trace.temperature_k)]
    if len(points) > 1:
        pen.line(points, fill=(255, 110, 90), width=2)

    most_j = frames * float(drive.always_eight.laser_energy_j)
    y = lane(2, "laser energy", 0.0, most_j)
    pen.line((x(0), y(0.0), x(frames), y(most_j)), fill=FAINT)
    pen.text((left + 4, y(most_j) + 3), f"gray: always 8, {most_j:.2f} J", FAINT, font, "la")
    spent_j = np.cumsum((0.0, *trace.laser_energy_j)).tolist()
    if len(spent_j) > 1:
        pen.line([(x(i), y(j)) for i, j in enumerate(spent_j)], fill=(120, 220, 120), width=2)
    return image
