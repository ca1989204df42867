"""Sheets of pictures: images beside and below each other, with words and colour bars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from unwrap.pictures.colors import ColorMap, paint

NARROWEST_TILE_PX = 160
GAP_PX, MARGIN_PX = 4, 14
SMALL_PX, LARGE_PX = 13, 18
PAPER, INK, FAINT = (255, 255, 255), (20, 22, 26), (100, 106, 116)
BAR_HEIGHT_PX = 12


def enlarged(image: Image.Image, narrowest_px: int = NARROWEST_TILE_PX) -> Image.Image:
    """Small images by a whole factor, so that each pixel stays a square."""
    # -(-a // b) is a / b rounded up.
    return image.convert("RGB").resize(
        [size * max(1, -(-narrowest_px // image.width)) for size in image.size],
        Image.Resampling.NEAREST,
    )


def bar(name: str, colors: ColorMap, width: int, scale: int) -> Image.Image:
    """Name, colours and ticks of `colors`, `width` pixels wide; `scale` times the usual size."""
    small = scale * SMALL_PX
    ramp = np.tile(np.linspace(colors.low, colors.high, width), (scale * BAR_HEIGHT_PX, 1))
    ticks = Image.new("RGB", (width, small + 4), PAPER)
    pen = ImageDraw.Draw(ticks)
    # Pillow's anchors: left, middle or right end of the words at the place, their top at it.
    for part, anchor, tick in zip((0.0, 0.5, 1.0), ("la", "ma", "ra"), colors.ticks, strict=True):
        pen.text((part * (width - 1), 0), tick, FAINT, _font(small), anchor)
    words = line([text(name, small), text(colors.unit, small, FAINT)])
    return column([words, paint(ramp, colors).convert("RGB"), ticks])


def text(words: str, size: int, color: tuple[int, int, int] = INK) -> Image.Image:
    """`words` in one line, `size` pixels high."""
    font = _font(size)
    image = Image.new("RGB", (int(font.getlength(words)) + size // 2, size + size // 3), PAPER)
    ImageDraw.Draw(image).text((0, size), words, color, font, "ls")
    return image


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    # It comes with Pillow: pictures look alike wherever they are made.
    return ImageFont.load_default(size)


def line(images: Sequence[Image.Image], gap: int = GAP_PX) -> Image.Image:
    """Images side by side, standing on one line."""
    height = max(image.height for image in images)
    joined = Image.new("RGB", (sum(i.width + gap for i in images) - gap, height), PAPER)
    left = 0
    for image in images:
        joined.paste(image, (left, height - image.height))
        left += image.width + gap
    return joined


def column(images: Sequence[Image.Image], gap: int = GAP_PX) -> Image.Image:
    """Images below each other, from the left."""
    width = max(image.width for image in images)
    joined = Image.new("RGB", (width, sum(i.height + gap for i in images) - gap), PAPER)
    top = 0
    for image in images:
        joined.paste(image, (0, top))
        top += image.height + gap
    return joined


def framed(image: Image.Image) -> Image.Image:
    """`image` with a margin."""
    size = (image.width + 2 * MARGIN_PX, image.height + 2 * MARGIN_PX)
    frame = Image.new("RGB", size, PAPER)
    frame.paste(image, (MARGIN_PX, MARGIN_PX))
    return frame
