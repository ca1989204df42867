"""What lies on a place, and packed arrays: how they come about, and what reads them."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from unittest import mock

import torch

FRAMES, HEIGHT, WIDTH = 2, 16, 24


def _bank(folder: Path, storage: str) -> Path:
    """A bank of one small clip for each split."""
    from shotenv.config import BankConfig, SensorConfig, find_config, merged, read_config
    from tests.helpers.made_up_clips import write_made_up_bank

    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    small = {
        "camera": {"width": WIDTH, "height": HEIGHT},
        "world": {"frames_per_clip": FRAMES, "families": ["garage"]},
        **{"train_clips": 1, "validation_clips": 1, "test_clips": 1, "storage": storage},
    }
    return write_made_up_bank(merged(BankConfig(name="small", sensor=sensor), small), folder)


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
