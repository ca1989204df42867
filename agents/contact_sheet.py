"""Contact sheets: what a bank looks like, one row for each scene family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont

from agents.pictures import CYCLIC, ERROR, GRAY, VIRIDIS, ColorMap, paint
from shotenv.bank import Bank, BankError, Clip
from shotenv.config import SensorConfig
from shotenv.sensor.converter import full_scale_lsb
from unwrap.acquisition import SAMPLES_PER_FREQUENCY
from unwrap.phase import decode, distance_m, unambiguous_range_m

CLIPS_PER_FAMILY = 3
NARROWEST_TILE_PX = 160
GAP_PX, MARGIN_PX = 4, 14
SMALL_PX, LARGE_PX = 13, 18
PAPER, INK, FAINT = (255, 255, 255), (20, 22, 26), (100, 106, 116)
BAR_HEIGHT_PX = 12
AMPLITUDE_DECADES = (-5.0, 0.0)


def contact_sheet(bank: Bank, *, clips: int = CLIPS_PER_FAMILY) -> Image.Image:
    """Middle frames of some clips of each family, as the renderer left them: without sensor noise.

    Each shows the gray image, the true distance, and wrapped distance and amplitude at f1.

    Parameters
    ----------
    bank : Bank
        A rendered bank.
    clips : int
        Of each family, at least 1; one from each of its splits before a second from any.

    Raises
    ------
    BankError
        An imported bank, whose frequencies nothing tells.
    """
    if bank.config is None:
        raise BankError(f"bank {bank.folder} was imported: nothing tells its frequencies")
    maps, scale = color_maps(bank.config.sensor), max(1, bank.width // NARROWEST_TILE_PX)
    rows = [_row(bank, of, clips, maps, scale) for of in clips_by_family(bank).values()]
    legend = _legend(maps, max(row.width for row in rows), scale)
    return _framed(_column([_title(bank, scale), *rows, legend], gap=2 * GAP_PX * scale))


def color_maps(sensor: SensorConfig) -> dict[str, ColorMap]:
    """How each of the pictures of a clip is coloured."""
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    return {
        "gray image": ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY),
        "distance": ColorMap(0.0, sensor.max_range_m, "m, clipped above", VIRIDIS),
        "wrapped distance": ColorMap(0.0, unambiguous_m, "m, noise-free", CYCLIC),
        "amplitude": ColorMap(*AMPLITUDE_DECADES, "log10, W/m2/sr per W", ERROR),
    }


def clips_by_family(bank: Bank) -> dict[str, list[Clip]]:
    """Clips of each family, in the order in which the families first come."""
    families: dict[str, list[Clip]] = {}
    for clip in bank.clips:
        families.setdefault(clip.family, []).append(clip)
    return families


def quantities(bank: Bank, index: int) -> dict[str, np.ndarray]:
    """What `color_maps` colours, of the frame `index`: each float [H, W]."""
    frame, sensor = bank.frame(index), bank.config.sensor
    first = decode(frame.exposure.correlation[0, :SAMPLES_PER_FREQUENCY])
    lit = first.amplitude > 0
    wrapped_m = torch.where(lit, distance_m(first.phase_rad, sensor.f1_hz), torch.nan)
    return {
        "gray image": (frame.gray.numpy() / full_scale_lsb(sensor.adc_bits)) ** 0.5,
        "distance": frame.exposure.distance_m[0].numpy(),
        "wrapped distance": wrapped_m.numpy(),
        "amplitude": torch.where(lit, first.amplitude.log10(), torch.nan).numpy(),
    }


def choose(clips: Sequence[Clip], count: int) -> list[Clip]:
    """`count` clips of one family: the first of each of its splits, then the second of each, ..."""
    splits = [[c for c in clips if c.split == split] for split in Counter(c.split for c in clips)]
    in_turn = [clip for turn in zip_longest(*splits) for clip in turn if clip is not None]
    return sorted(in_turn[:count], key=lambda clip: clip.start)


def _title(bank: Bank, scale: int) -> Image.Image:
    name, size = bank.manifest.name, f"{bank.width} x {bank.height}"
    words = f"{name}: {len(bank)} frames of {size} pixels in {len(bank.clips)} clips"
    note = "light gray: sky, or no laser light comes back"
    return _line([_text(words, scale * LARGE_PX), _text(note, scale * SMALL_PX, FAINT)])


def _row(
    bank: Bank, of: Sequence[Clip], count: int, maps: dict[str, ColorMap], scale: int
) -> Image.Image:
    """Heading and pictures of one family."""
    shares = Counter(clip.split for clip in of)
    told = ", ".join(f"{number} {split}" for split, number in shares.items())
    heading = [
        _text(of[0].family, scale * LARGE_PX),
        _text(f"{told} clips", scale * SMALL_PX, FAINT),
    ]
    blocks = [_block(bank, clip, maps, scale) for clip in choose(of, count)]
    return _column([_line(heading), _line(blocks, gap=MARGIN_PX)])


def _block(bank: Bank, clip: Clip, maps: dict[str, ColorMap], scale: int) -> Image.Image:
    """Caption and pictures of one clip."""
    middle = clip.frames // 2
    index = clip.start + middle
    speed_m_s, exposure_s = bank.ego_speed_m_s[index], bank.gray_exposure_s[index]
    caption = (
        f"{clip.split}   seed {clip.seed}   frame {middle + 1} of {clip.frames}   "
        f"{speed_m_s:.1f} m/s   gray {1e3 * exposure_s:.2g} ms"
    )
    found = quantities(bank, index)
    tiles = [_enlarged(paint(found[name], colors)) for name, colors in maps.items()]
    return _column([_text(caption, scale * SMALL_PX, FAINT), _line(tiles)])


def _enlarged(image: Image.Image) -> Image.Image:
    """Small images by a whole factor, so that each pixel stays a square."""
    return image.convert("RGB").resize(
        [size * max(1, -(-NARROWEST_TILE_PX // image.width)) for size in image.size],
        Image.Resampling.NEAREST,
    )


def _legend(maps: dict[str, ColorMap], width: int, scale: int) -> Image.Image:
    """A colour bar for each picture, over the whole width."""
    each = (width - (len(maps) - 1) * 2 * MARGIN_PX) // len(maps)
    bars = [_bar(name, colors, each, scale) for name, colors in maps.items()]
    return _line(bars, gap=2 * MARGIN_PX)


def _bar(name: str, colors: ColorMap, width: int, scale: int) -> Image.Image:
    small = scale * SMALL_PX
    ramp = np.tile(np.linspace(colors.low, colors.high, width), (scale * BAR_HEIGHT_PX, 1))
    ticks = Image.new("RGB", (width, small + 4), PAPER)
    pen = ImageDraw.Draw(ticks)
    for part, anchor, tick in zip((0.0, 0.5, 1.0), ("la", "ma", "ra"), colors.ticks, strict=True):
        pen.text((part * (width - 1), 0), tick, FAINT, _font(small), anchor)
    words = _line([_text(name, small), _text(colors.unit, small, FAINT)])
    return _column([words, paint(ramp, colors).convert("RGB"), ticks])


def _text(words: str, size: int, color: tuple[int, int, int] = INK) -> Image.Image:
    font = _font(size)
    image = Image.new("RGB", (int(font.getlength(words)) + size // 2, size + size // 3), PAPER)
    ImageDraw.Draw(image).text((0, size), words, color, font, "ls")
    return image


def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


def _line(images: Sequence[Image.Image], gap: int = GAP_PX) -> Image.Image:
    """Images side by side, standing on one line."""
    height = max(image.height for image in images)
    line = Image.new("RGB", (sum(i.width + gap for i in images) - gap, height), PAPER)
    left = 0
    for image in images:
        line.paste(image, (left, height - image.height))
        left += image.width + gap
    return line


def _column(images: Sequence[Image.Image], gap: int = GAP_PX) -> Image.Image:
    """Images below each other, from the left."""
    width = max(image.width for image in images)
    column = Image.new("RGB", (width, sum(i.height + gap for i in images) - gap), PAPER)
    top = 0
    for image in images:
        column.paste(image, (0, top))
        top += image.height + gap
    return column


def _framed(image: Image.Image) -> Image.Image:
    size = (image.width + 2 * MARGIN_PX, image.height + 2 * MARGIN_PX)
    frame = Image.new("RGB", size, PAPER)
    frame.paste(image, (MARGIN_PX, MARGIN_PX))
    return frame
