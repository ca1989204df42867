"""Make a thinned bank of a rendered one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import torch

from shotenv.bank import (
    FARTHEST_M,
    LOG_AMBIENT,
    Bank,
    BankError,
    ClipFacts,
    StoredNetwork,
    ThinnedBank,
    encode_light,
    keep_predictions,
    require_full,
    write_thinned,
)
from shotenv.decision import look_at_scenes, probe_features
from unwrap.networks import Unwrapper, load_unwrapper

GRAY_NETWORKS = ("tofregnet", "tofsegnet")
"""Shipped networks that look at the gray image alone."""


def thin_bank(
    bank: Bank,
    folder: Path,
    *,
    every: int = 8,
    name: str | None = None,
    seed: int = 0,
    networks: Sequence[str] = GRAY_NETWORKS,
    tick: Callable[[int], object] = lambda frames: None,
) -> ThinnedBank:
    """Write a thinned bank with one random pixel of each `every` x `every`, and open it.

    Networks predict on the full frames, of which the scene features are made as well.

    Parameters
    ----------
    bank : Bank
        A rendered bank.
    folder : Path
        Of the thinned bank; must not exist yet, or be empty.
    every : int
        At least 2; height and width are multiples of it.
    name : str, optional
        Of the thinned bank; that of the folder by default.
    seed : int
        Of the positions, which are drawn once for all frames.
    networks : sequence of str
        Names or paths of networks that look at the gray image alone.
    tick : callable
        Is told the number of frames after each clip.

    Raises
    ------
    ValueError
        A setting that does not fit, a network that needs samples, an imported or thinned bank, or a
        folder that cannot be written.
    """
    require_full(bank, "thinning")
    if bank.config is None:
        raise BankError(f"bank {bank.name} was imported: nothing tells the sensor of its images")
    if every < 2 or bank.height % every or bank.width % every:
        raise BankError(
            f"every is {every}; expected at least 2, and a divisor of {bank.height} and "
            f"{bank.width}, the height and width of bank {bank.name}"
        )
    sensor = bank.config.sensor
    if sensor.max_range_m >= FARTHEST_M:
        raise BankError(
            f"sensor.max_range_m is {sensor.max_range_m:g}; a thinned bank holds distances up to "
            f"{FARTHEST_M:g} m"
        )
    unwrappers = [load_unwrapper(each) for each in networks]
    _check_networks(unwrappers)
    rows, columns = draw_positions(bank.height, bank.width, every, seed=seed)
    stored = [
        StoredNetwork(
            name=each.name, fingerprint=each.fingerprint, macs=each.macs(bank.height, bank.width)
        )
        for each in unwrappers
    ]
    arrays: dict[str, np.ndarray] = {}
    for network, unwrapper in zip(stored, unwrappers, strict=True):
        kept = keep_predictions(bank, unwrapper)
        scenes = look_at_scenes(bank, bank.clips, kept, sensor)
        arrays[network.distances] = kept.distance_m.numpy()[:, rows, columns]
        arrays[network.features] = scenes.features.numpy()
        arrays[LOG_AMBIENT] = scenes.log_ambient.numpy()
    light, units = encode_light(maps_at(bank, rows, columns, tick=tick))
    probe = probe_features(sensor)
    contents = {
        "name": name or folder.resolve().name,
        "height": rows.shape[0],
        "width": rows.shape[1],
        "config": bank.config.model_dump(mode="json"),
        "source": bank.fingerprint,
        "every": every,
        "seed": seed,
        "rows": rows.tolist(),
        "columns": columns.tolist(),
        "scene_features": list(probe),
        "probe": list(probe.values()),
        "networks": [network.model_dump() for network in stored],
        "clips": [
            clip.model_dump(mode="json", include=set(ClipFacts.model_fields))
            for clip in bank.manifest.clips
        ],
        **units,
    }
    write_thinned(folder, {**light, **arrays}, contents)
    return ThinnedBank(folder)


def draw_positions(
    height: int, width: int, every: int, *, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns, each int64 [height / every, width / every]: a random pixel of each cell."""
    random = np.random.default_rng(seed)
    down, across = np.indices((height // every, width // every)) * every
    within = random.integers(0, every, (2, *down.shape))
    return down + within[0], across + within[1]


def maps_at(
    bank: Bank,
    rows: np.ndarray,
    columns: np.ndarray,
    *,
    tick: Callable[[int], object] = lambda frames: None,
) -> dict[str, np.ndarray]:
    """Light and gray images of all frames of a bank at `rows`, `columns`, each [H, W]."""
    found: dict[str, list[np.ndarray]] = {}
    # Clip by clip: all frames at once would fill the memory.
    for clip in bank.clips:
        frames = torch.arange(clip.start, clip.start + clip.frames)
        maps = {**vars(bank.exposure(frames)), "gray": bank.gray(frames)}
        for name, each in maps.items():
            found.setdefault(name, []).append(each.numpy()[..., rows, columns])
        tick(clip.frames)
    return {name: np.concatenate(parts) for name, parts in found.items()}


def _check_networks(networks: Sequence[Unwrapper]) -> None:
    """Refuse networks whose predictions cannot be stored."""
    names = [each.name for each in networks]
    for each in networks:
        if each.network.needs == "samples":
            raise BankError(f"{each.name} needs samples, which differ from drive to drive")
    if not names or len(set(names)) < len(names):
        raise BankError(f"networks are {names}; expected at least one, and each name once")
