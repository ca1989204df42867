"""What lies on a place, and packed arrays: how they come about, and what reads them."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import numpy as np
import torch

FRAMES, HEIGHT, WIDTH = 2, 16, 24


def _bank(folder: Path, storage: str) -> Path:
    """A bank of one small clip for each split."""
    from shotenv.bank.files import ARRAYS, write_clip, write_manifest
    from shotenv.config import BankConfig, SensorConfig, find_config, merged, read_config

    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    size = {"camera": {"width": WIDTH, "height": HEIGHT}, "world": {"frames_per_clip": FRAMES}}
    config = merged(BankConfig(name="small", sensor=sensor), {**size, "storage": storage})
    per_frame = ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
    records = []
    for number, split in enumerate(("train", "validation", "test")):
        random = np.random.default_rng(number)
        arrays = {
            name: random.random((FRAMES, *spec.channels, HEIGHT, WIDTH)).astype(spec.dtype)
            for name, spec in ARRAYS.items()
        }
        about = {"name": f"c{number}", "family": "garage", "seed": number, "split": split}
        where = folder / "clips" / f"c{number}"
        told = about | dict.fromkeys(per_frame, [0.5] * FRAMES)
        records.append(write_clip(where, arrays, told, storage=config.storage))
    write_manifest(folder, config.name, records, (HEIGHT, WIDTH), config)
    return folder


def packed(folder: Path) -> Path:
    """An array of a packed bank."""
    return next(_bank(folder / "bank", "float16").rglob("correlation.zst"))


def read_packed(path: Path) -> object:
    """Each frame of its bank."""
    from shotenv.bank import open_bank

    bank = open_bank(path.parents[2], render=False)
    return [bank.exposure(torch.arange(len(bank))), bank.gray(torch.arange(len(bank)))]


def published(name: str) -> Callable[[Path], Path]:
    """A file on a place that holds a bank; `name` may be a pattern."""

    def make(folder: Path) -> Path:
        from shotenv.bank import open_bank, publish_bank

        bank = _bank(folder / "made", "float32")
        publish_bank(open_bank(bank), _url(folder / "place"))
        shutil.rmtree(bank)
        return min((folder / "place").glob(name))

    return make


def read_published(path: Path) -> object:
    """The bank, fetched into an empty cache and opened; then what is continued of it."""
    from shotenv.bank import open_bank
    from unwrap.storage import Place, standing_parts

    place = next(one for one in path.parents if one.name == "place")
    cache = place.with_name("cache")
    shutil.rmtree(cache, ignore_errors=True)
    os.environ["SHOTENV_CACHE"] = str(cache)
    url = _url(place)
    label = next((place / "parts").iterdir()).name
    standing = standing_parts(Place(url), label)
    return len(open_bank(url)), standing


def unfinished(folder: Path) -> Path:
    """What a training on a place has come to."""
    from agents.study import published_work
    from agents.training import CHECKPOINT
    from unwrap.support import write_bytes

    run, place = folder / "run", folder / "place"
    shelf = published_work.Shelf(_url(place), "study")
    with (
        mock.patch.object(published_work, "KEPT_EVERY_S", 0.02),
        shelf.resumed("a-0", {}, run),
    ):
        run.mkdir()
        write_bytes(run / "policy.safetensors", bytes(1000))
        write_bytes(run / CHECKPOINT, bytes(range(256)) * 8)
        while not (found := sorted(place.rglob("a-0-*.zip"))):
            time.sleep(0.02)
    return found[0]


def read_unfinished(path: Path) -> object:
    """Into the folder of a training that goes on."""
    from agents.study.published_work import Shelf

    place = next(one for one in path.parents if one.name == "place")
    into = place.with_name("resumed")
    shutil.rmtree(into, ignore_errors=True)
    with Shelf(_url(place), "study").resumed("a-0", {}, into):
        return sorted(into.glob("*"))


def _url(folder: Path) -> str:
    return f"file://{folder}"
