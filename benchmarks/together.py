"""Training on two processes of one thread against one process of two threads, side by side."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from benchmarks.rows import row
from unwrap.signal import Sensed, SensorDescription, Shots, Truth
from unwrap.training import TrainConfig, train

CONFIG = TrainConfig(width=32, batch_size=16, epochs=1)
HEIGHT, WIDTH = 120, 160
FRAMES = {"train": 320, "validation": 16, "test": 1}
GOAL = 0.7
"""Two processes exchange gradients and statistics, and each starts Python and torch anew."""


class Images:
    """Frames without meaning, whose making costs nothing beside a step."""

    def __init__(self, split: str) -> None:
        self.sensor, self.families = SensorDescription(), ["image"] * FRAMES[split]

    def __len__(self) -> int:
        return len(self.families)

    def batch(
        self, numbers: Sequence[int], *, draw: int, shots: Shots | None
    ) -> tuple[Sensed, Truth]:
        """Ramps of gray, and of distance."""
        gray = torch.linspace(0, 1, WIDTH).expand(len(numbers), HEIGHT, WIDTH).contiguous()
        return Sensed(gray), Truth(25 * gray, torch.ones_like(gray, dtype=torch.bool))


def run() -> list[dict[str, Any]]:
    """One row: rate of two processes over that of one. Takes some minutes."""
    together_s, alone_s = [], []
    # One epoch more is what it costs without the start and the judging, which both have.
    for _ in range(2):
        alone_s.append(_epoch_s(1))
        together_s.append(_epoch_s(2))
    ratio = min(alone_s) / min(together_s)
    note = f"{min(together_s):.0f} s an epoch on two processes, {min(alone_s):.0f} s on two threads"
    return [row("2 processes x 1 thread / 1 x 2 threads", ratio, ">=", GOAL, note)]


def _epoch_s(devices: int) -> float:
    """Seconds of an epoch: of two epochs minus those of one."""
    one, two = (_training_s(CONFIG.model_copy(update={"epochs": n}), devices) for n in (1, 2))
    return two - one


def _training_s(config: TrainConfig, devices: int) -> float:
    with tempfile.TemporaryDirectory() as out, _threads(2):
        begun = time.monotonic()
        train(config, Images, Path(out), devices=devices, progress=False)
        return time.monotonic() - begun


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Torch computes with so many threads here, and in processes shares them out."""
    before, told = torch.get_num_threads(), os.environ.pop("OMP_NUM_THREADS", None)
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
        if told is not None:
            os.environ["OMP_NUM_THREADS"] = told
