"""Walls whose frames do not depend on the batch that they come in, for processes that share it."""

from __future__ import annotations

import atexit
import os
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch
from unwrap_source import Walls

from unwrap.signal import Memory, Sensed, Shots, Truth
from unwrap.support import concatenate

FRAMES = {"train": 10, "validation": 9, "test": 3}
"""So that batches of four leave one of two frames, and two processes three validation batches."""


class SharedWalls(Walls):
    """Each frame has its own noise, memory and share of known pixels."""

    def batch(
        self, numbers: Sequence[int], *, draw: int, shots: Shots | None
    ) -> tuple[Sensed, Truth]:
        """The frames, each made for itself."""
        return concatenate([self._frame(number, draw, shots) for number in numbers])

    def _frame(self, number: int, draw: int, shots: Shots | None) -> tuple[Sensed, Truth]:
        sensed, truth = super().batch([number], draw=draw, shots=shots)
        generator = torch.Generator().manual_seed(number)
        share = 0.2 + 0.1 * (number % 7)
        known = torch.rand(truth.known.shape, generator=generator) < share
        if shots is not None:
            memory = Memory(truth.distance_m, torch.ones_like(truth.distance_m))
            sensed = replace(sensed, memory=memory)
        return sensed, replace(truth, known=known)


def walls(split: str) -> SharedWalls:
    """The frames of a split."""
    return SharedWalls(FRAMES[split], seed=len(split))


def precise_walls(split: str) -> SharedWalls:
    """The same, where networks compute in float64 from now on, in the process that asks."""
    torch.set_default_dtype(torch.float64)
    return walls(split)


def deadly_walls(split: str) -> SharedWalls:
    """The same; the second of several processes is killed as it asks for the frames."""
    if os.environ.get("LOCAL_RANK") == "1":
        os.kill(os.getpid(), signal.SIGKILL)
    return walls(split)


def stopping_walls(split: str) -> SharedWalls:
    """The same; the second of several processes is stopped as it asks for the frames."""
    if os.environ.get("LOCAL_RANK") == "1":
        os.kill(os.getpid(), signal.SIGSTOP)
    return walls(split)


def raise_before_others(mark: Path) -> None:
    """The second process raises and ends late; the first soon misses it, a third only waits."""
    rank = os.environ["LOCAL_RANK"]
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    ready = mark.with_suffix(".ready")
    if rank == "0":
        ready.touch()
    if rank == "1":
        while not ready.exists():
            time.sleep(0.05)
        atexit.register(time.sleep, 3)
        mark.touch()
        raise ValueError("frame 7 is damaged")
    while rank != "0" or not mark.exists():
        time.sleep(0.1)
    time.sleep(0.5)
    raise ConnectionResetError("connection closed by peer")


class DyingNode:
    """Frames of which the second of two machines has none in the third epoch: it is lost then."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __call__(self, split: str) -> SharedWalls:
        """The frames of a split."""
        source = precise_walls(split)
        batch = source.batch

        def until_then(numbers, *, draw, shots):
            if draw == 3 and os.environ["NODE_RANK"] == "1":
                self.mark.touch()
                os.killpg(0, signal.SIGKILL)
            return batch(numbers, draw=draw, shots=shots)

        source.batch = until_then
        return source


def train_node(out: str, mark: str) -> None:
    """What each of two machines is called with."""
    from unwrap.training import TrainConfig, train

    config = TrainConfig(width=4, epochs=3, batch_size=4)
    train(config, DyingNode(Path(mark)), Path(out), nodes=2, progress=False)


def train_two(out: str) -> None:
    """Train on two processes for long, for a test that interrupts this one."""
    from unwrap.training import TrainConfig, train

    config = TrainConfig(width=4, epochs=10_000, batch_size=4)
    train(config, walls, Path(out), devices=2, progress=False)


if __name__ == "__main__":
    train_node(*sys.argv[1:]) if "NODE_RANK" in os.environ else train_two(sys.argv[1])
