"""Contact sheets: what a bank looks like, one row for each scene family."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import zip_longest

import numpy as np
import torch
from PIL import Image

from shotenv.bank import Bank, BankError, Clip, RecordedBank, require_full
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
from unwrap.signal import SAMPLES_PER_FREQUENCY, Shots, decode, distance_m, unambiguous_range_m

CLIPS_PER_FAMILY = 3
AMPLITUDE_DECADES = (-5.0, 0.0)
"""Of log10 of the amplitude: a dark wall at 25 m to a bright one at hand."""
RECORDED_DECADES = (0.0, 3.5)
"""The same of samples in LSB, up to those that overflow 12 bits."""


def contact_sheet(bank: Bank, *, clips: int = CLIPS_PER_FAMILY) -> Image.Image:
    """Middle frames of some clips of each family, as the renderer left them: without sensor noise.

    Of recordings their first four samples, and the reference where there is one. Each shows the
    gray image, the true distance, and wrapped distance and amplitude at f1.

    Parameters
    ----------
    bank : Bank
        A rendered bank, or one of recordings.
    clips : int
        Of each family, at least 1; one from each of its splits before a second from any.

    Raises
    ------
    BankError
        An imported bank, whose frequencies nothing tells; a thinned one, which has no pictures.
    """
    require_full(bank, "a contact sheet")
    maps, scale = color_maps(bank), max(1, bank.width // NARROWEST_TILE_PX)
    title = [
        text(
            f"{bank.name}: {len(bank)} frames of {bank.width} x {bank.height} pixels in "
            f"{len(bank.clips)} clips",
            scale * LARGE_PX,
        ),
        text("light gray: sky, or no laser light comes back", scale * SMALL_PX, FAINT),
    ]
    rows = [_row(bank, kin, clips, maps, scale) for kin in clips_by_family(bank).values()]
    # The colour bars share the whole width, with a gap between them.
    width = max(row.width for row in rows)
    each = (width - (len(maps) - 1) * 2 * MARGIN_PX) // len(maps)
    legend = line([bar(name, maps[name], each, scale) for name in maps], gap=2 * MARGIN_PX)
    return framed(column([line(title), *rows, legend], gap=2 * GAP_PX * scale))


def sensor_of(bank: Bank) -> SensorConfig:
    """The sensor that a bank was rendered for, or that its recordings are of.

    Raises
    ------
    BankError
        It does not tell.
    """
    if isinstance(bank, RecordedBank):
        return bank.manifest.sensor
    if bank.config is None:
        raise BankError(f"bank {bank.folder} was imported: nothing tells its frequencies")
    return bank.config.sensor


def color_maps(bank: Bank) -> dict[str, ColorMap]:
    """How each of the pictures of a clip is coloured."""
    sensor = sensor_of(bank)
    amplitude = ColorMap(*AMPLITUDE_DECADES, "log10, W/m2/sr per W", ERROR)
    if bank.is_recorded:
        amplitude = ColorMap(*RECORDED_DECADES, "log10, LSB", ERROR)
    unambiguous_m = unambiguous_range_m(sensor.f1_hz)
    told = "m, of 4 samples" if bank.is_recorded else "m, noise-free"
    return {
        "gray image": ColorMap(0.0, 1.0, "share of full scale, gamma 0.5", GRAY),
        "distance": ColorMap(0.0, sensor.max_range_m, "m, clipped above", VIRIDIS),
        "wrapped distance": ColorMap(0.0, unambiguous_m, told, CYCLIC),
        "amplitude": amplitude,
    }


def clips_by_family(bank: Bank) -> dict[str, list[Clip]]:
    """Clips of each family, in the order in which the families first come."""
    families: dict[str, list[Clip]] = {}
    for clip in bank.clips:
        families.setdefault(clip.family, []).append(clip)
    return families


def maps_of(bank: Bank, index: int) -> dict[str, np.ndarray]:
    """Pictures of frame `index` before they are coloured, each float [H, W]; see `color_maps`."""
    sensor, one = sensor_of(bank), torch.tensor([index])
    if isinstance(bank, RecordedBank):
        samples, truth_m = bank.words(one, Shots.FOUR).dcs_lsb[0], bank.distance_m(one)[0]
    else:
        # Noise-free light in place of samples: phase and amplitude are decoded from it just so.
        light = bank.exposure(one)
        samples, truth_m = light.correlation[0, :SAMPLES_PER_FREQUENCY], light.distance_m[0]
    first = decode(samples)
    lit = first.amplitude > 0
    wrapped_m = torch.where(lit, distance_m(first.phase_rad, sensor.f1_hz), torch.nan)
    return {
        # Dark scenes would be black without the gamma, as in `env.picture`.
        "gray image": (bank.gray(one)[0].numpy() / full_scale_lsb(sensor.adc_bits)) ** 0.5,
        "distance": truth_m.numpy(),
        "wrapped distance": wrapped_m.numpy(),
        "amplitude": torch.where(lit, first.amplitude.log10(), torch.nan).numpy(),
    }


def clips_shown(clips: Sequence[Clip], count: int) -> list[Clip]:
    """At most `count` of the clips of one family, in their order.

    The first of each of its splits, then the second of each, and so on: of five clips for training,
    two for validation and one for testing, three are one of each.
    """
    splits = [[c for c in clips if c.split == split] for split in Counter(c.split for c in clips)]
    in_turn = [clip for turn in zip_longest(*splits) for clip in turn if clip is not None]
    return sorted(in_turn[:count], key=lambda clip: clip.start)


def _row(
    bank: Bank, kin: Sequence[Clip], count: int, maps: dict[str, ColorMap], scale: int
) -> Image.Image:
    """Heading and pictures of one family, whose clips are `kin`."""
    shares = Counter(clip.split for clip in kin)
    told = ", ".join(f"{number} {split}" for split, number in shares.items())
    heading = [
        text(kin[0].family, scale * LARGE_PX),
        text(f"{told} clips", scale * SMALL_PX, FAINT),
    ]
    blocks = [_block(bank, clip, maps, scale) for clip in clips_shown(kin, count)]
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
    found = maps_of(bank, index)
    tiles = [enlarged(paint(found[name], colors)) for name, colors in maps.items()]
    return column([text(caption, scale * SMALL_PX, FAINT), line(tiles)])
