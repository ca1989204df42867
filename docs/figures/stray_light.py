"""Figure of what the lens does: veiling glare and a ghost around a bright sheet."""

from __future__ import annotations

import numpy as np

from figures.stage import BLUE, GREEN, PER_RADIAN_M, RED, SENSOR, Made, Row, axes, label, show
from shotenv.config import find_config, read_config
from shotenv.config.reader import merged
from shotenv.config.sensor import SensorConfig
from shotenv.render.lens import through_lens

HEIGHT, WIDTH = 120, 160
WALL_M, SHEET_M, BRIGHTER = 5.0, 3.5, 300.0
"""A wall, and before it a retro-reflecting sheet with so many times its light."""


def stray_light() -> Made:
    """Error of distance around a retro-reflecting sheet, and of a dark wall by a near object."""
    figure, (left, right) = axes(
        "Error around a sheet, 1 % glare", "Wall at 5 m beside one at 3.5 m"
    )
    light = np.full((HEIGHT, WIDTH), np.exp(1j * WALL_M / PER_RADIAN_M))
    light[30:50, 30:60] = BRIGHTER * np.exp(1j * SHEET_M / PER_RADIAN_M)
    shipped = read_config(SensorConfig, find_config("sensor", "epc660"))
    error_m = errors_m(light, shipped)
    error_m[30:50, 30:60] = np.nan
    image = show(figure, left, error_m, cmap="viridis", vmin=-0.5, vmax=0.0)
    figure.colorbar(image, ax=left, label="m", shrink=0.7)
    ratios, near = np.geomspace(1, 1000, 13), WIDTH // 2
    rows = []
    for share, colour in ((0.001, GREEN), (0.01, BLUE), (0.03, RED)):
        lens = merged(SENSOR, {"veiling_glare": share})
        found_m, phasor = [], np.exp(1j * SHEET_M / PER_RADIAN_M)
        for ratio in ratios:
            half = np.full((HEIGHT, WIDTH), np.exp(1j * WALL_M / PER_RADIAN_M))
            half[:, :near] = ratio * phasor
            # Half way between the edge and the border of the image.
            found_m.append(errors_m(half, lens)[HEIGHT // 2, 3 * WIDTH // 4])
        right.plot(ratios, -np.array(found_m), color=colour, label=f"glare {100 * share:g} %")
        if share == 0.01:
            # Of the near half's glare, the Gaussian's tail beyond, and that of the mirrored image.
            reached = glare_of_half(lens.veiling_glare_width)
            sum_ = (1 - share * reached) + share * reached * ratios[8] * np.exp(
                1j * (SHEET_M - WALL_M) / PER_RADIAN_M
            )
            rows.append(
                Row(
                    f"wall at 5 m, 1 % glare of a half image {ratios[8]:.0f} times as bright",
                    f"{1e3 * np.angle(sum_) * PER_RADIAN_M:.1f} mm",
                    f"{1e3 * found_m[8]:.1f} mm",
                )
            )
    right.set(xscale="log", yscale="log")
    label(right, "light of the near one over the far one's", "measured too near by, m")
    return figure, rows


def errors_m(light: np.ndarray, lens: SensorConfig) -> np.ndarray:
    """Measured distance less that of the wall, of complex light [H, W] at f1."""
    shown = through_lens(light.real, lens) + 1j * through_lens(light.imag, lens)
    return np.angle(shown * np.exp(-1j * WALL_M / PER_RADIAN_M)) * PER_RADIAN_M


def glare_of_half(width: float) -> float:
    """Share of the glare at 3/4 of an image's width that comes from its left half."""
    from scipy.stats import norm

    place = (3 * WIDTH // 4 + 0.5) / WIDTH
    # The left half and its images in the mirrored borders, two periods to each side.
    return sum(
        float(norm.cdf((place - low) / width) - norm.cdf((place - high) / width))
        for k in range(-2, 3)
        for low, high in ((2 * k - 0.5, 2 * k + 0.5),)
    )
