"""Contact sheets: what a bank looks like, one row for each scene family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
import torch
from PIL import Image

from shotenv.bank.bank import Bank, Clip
from shotenv.bank.layout import BankError
from shotenv.config import SensorConfig
from shotenv.sensor import full_scale_lsb
from unwrap.pictures import (
    CYCLIC,
    ERROR,
    FAINT,
    GAP_PX,
    GRAY,
    LARGE_PX,
    MARGIN_PX,
    NARROWEST_TILE_PX,
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
from unwrap.signal import SAMPLES_PER_FREQUENCY, decode, distance_m, unambiguous_range_m

CLIPS_PER_FAMILY = 3
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
    return framed(column([_title(bank, scale), *rows, legend], gap=2 * GAP_PX * scale))


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
    return line([text(words, scale * LARGE_PX), text(note, scale * SMALL_PX, FAINT)])


def _row(
    bank: Bank, of: Sequence[Clip], count: int, maps: dict[str, ColorMap], scale: int
) -> Image.Image:
    """Heading and pictures of one family."""
    shares = Counter(clip.split for clip in of)
    told = ", ".join(f"{number} {split}" for split, number in shares.items())
    heading = [
        text(of[0].family, scale * LARGE_PX),
        text(f"{told} clips", scale * SMALL_PX, FAINT),
    ]
    blocks = [_block(bank, clip, maps, scale) for clip in choose(of, count)]
    return column([line(heading), line(blocks, gap=MARGIN_PX)])


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
    tiles = [enlarged(paint(found[name], colors)) for name, colors in maps.items()]
    return column([text(caption, scale * SMALL_PX, FAINT), line(tiles)])


def _legend(maps: dict[str, ColorMap], width: int, scale: int) -> Image.Image:
    """A colour bar for each picture, over the whole width."""
    each = (width - (len(maps) - 1) * 2 * MARGIN_PX) // len(maps)
    bars = [bar(name, colors, each, scale) for name, colors in maps.items()]
    return line(bars, gap=2 * MARGIN_PX)
