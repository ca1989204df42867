"""Arrays to pictures that a page can hold: colour maps, PNG data URIs, colour bars."""

from __future__ import annotations

import base64
import io
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageColor

LEVELS = 255  # one of the 256 palette entries is left for "no value"
NO_VALUE_RGB = (214, 217, 222)


@dataclass(frozen=True)
class ColorMap:
    """How a quantity is coloured: from `low` to `high` in `unit`, through `anchors` (#rrggbb).

    What is not finite is drawn in `no_value` (red, green, blue).
    """

    low: float
    high: float
    unit: str
    anchors: tuple[str, ...]
    no_value: tuple[int, int, int] = NO_VALUE_RGB

    @property
    def palette(self) -> np.ndarray:
        """uint8 [256, 3]; the last entry stands for no value."""
        stops = np.linspace(0.0, 1.0, len(self.anchors))
        channels = np.array([ImageColor.getrgb(anchor) for anchor in self.anchors]).T
        position = np.linspace(0.0, 1.0, LEVELS)
        colors = np.stack([np.interp(position, stops, channel) for channel in channels], axis=-1)
        return np.vstack([colors.round(), [self.no_value]]).astype(np.uint8)

    @property
    def css(self) -> str:
        """The colour bar as a CSS gradient."""
        return f"linear-gradient(to right, {', '.join(self.anchors)})"

    @property
    def ticks(self) -> tuple[str, str, str]:
        """Low, middle and high as text."""
        low, middle, high = (
            f"{value:.3g}" for value in np.linspace(self.low, self.high, 3).tolist()
        )
        return low, middle, high


# Anchors of matplotlib's map of this name: its lightness grows steadily, also in print.
VIRIDIS = (
    *("#440154", "#482878", "#3e4989", "#31688e", "#26828e"),
    *("#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"),
)
# Ends as it begins: 0 and a whole unambiguous range are the same phase.
CYCLIC = ("#2b1c4f", "#3f5fb0", "#86b9cf", "#f0ece4", "#d99a6c", "#99334d", "#2b1c4f")
ERROR = ("#0b0b2a", "#4b1d6f", "#a02f6b", "#e4593f", "#fca50a", "#fcffa4")
GRAY = ("#000000", "#ffffff")


def paint(values: np.ndarray, colors: ColorMap) -> Image.Image:
    """Palette image of `values` [H, W]; what is not finite in the no-value colour."""
    scaled = (values - colors.low) / (colors.high - colors.low) * (LEVELS - 1)
    known = np.isfinite(scaled)
    # NaN is replaced before it is clipped and rounded: no integer is defined for it.
    index = np.where(known, np.clip(np.where(known, scaled, 0.0), 0, LEVELS - 1).round(), LEVELS)
    image = Image.frombytes("P", values.shape[::-1], index.astype(np.uint8).tobytes())
    image.putpalette(colors.palette.tobytes())
    return image


def picture(values: np.ndarray, colors: ColorMap) -> str:
    """`values` [H, W] painted, as a PNG data URI."""
    content = io.BytesIO()
    paint(values, colors).save(content, format="PNG", optimize=True)
    return "data:image/png;base64," + base64.b64encode(content.getvalue()).decode("ascii")
