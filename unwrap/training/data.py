"""What networks are trained on: batches of frames with their truth, in a new order each epoch."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, Protocol

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, Dataset, Sampler

from unwrap.signal import Sensed, SensorDescription, Shots, Truth
from unwrap.support import mapped
from unwrap.training.ranks import ALONE, Ranks, Share

SplitBy = Literal["clip", "frame"]
Batch = tuple[Sensed, Truth]


class Source(Protocol):
    """Frames that can be acquired again and again, each draw with other noise."""

    @property
    def sensor(self) -> SensorDescription:
        """What delivers the frames."""
        ...

    @property
    def families(self) -> Sequence[str]:
        """Kind of scene of each frame."""
        ...

    def __len__(self) -> int:
        """Number of frames."""
        ...

    def batch(self, numbers: Sequence[int], *, draw: int, shots: Shots | None) -> Batch:
        """Frames `numbers` with `shots` samples each, or none; the same draw gives the same."""
        ...


@dataclass(frozen=True)
class Augmentation:
    """How training images are varied.

    Attributes
    ----------
    flip_horizontal, flip_vertical : bool
        Mirror half of the images about that axis. The paper does both; upside down, a road
        camera's image no longer tells where the ground is.
    contrast : float
        Gray is raised to a power drawn from [1 / (1 + contrast), 1 + contrast].
    brightness : float
        Gray is multiplied by a factor drawn from the same kind of interval, then clipped at 1.
    """

    flip_horizontal: bool
    flip_vertical: bool
    contrast: float
    brightness: float

    def __call__(
        self,
        sensed: Sensed,
        truth: Truth,
        *,
        generator: torch.Generator,
        share: Share | None = None,
    ) -> tuple[Sensed, Truth]:
        """Vary frames, all of a batch or a `share`, and their truth alike; fresh tensors."""
        share = share or Share(len(sensed))
        # Drawn whether or not they are used, so that no option changes what the others draw.
        sideways, upside = torch.rand(2, share.frames, generator=generator)[:, share.places] < 0.5
        drawn = torch.rand(2, share.frames, generator=generator)[:, share.places]
        exponent, factor = 2 * drawn - 1
        for wanted, chosen, axis in (
            (self.flip_horizontal, sideways, -1),
            (self.flip_vertical, upside, -2),
        ):
            if wanted:
                flip = partial(_flip, chosen=chosen, axis=axis)
                sensed, truth = mapped(flip, sensed), mapped(flip, truth)
        # A power of a number in [-1, 1]: as often darker as lighter, by the same factors.
        gamma = (1 + self.contrast) ** exponent.to(sensed.gray.device)
        gain = (1 + self.brightness) ** factor.to(sensed.gray.device)
        gray = sensed.gray ** gamma[:, None, None] * gain[:, None, None]
        return replace(sensed, gray=gray.clamp(0, 1)), truth


def _flip(images: Tensor, *, chosen: Tensor, axis: int) -> Tensor:
    """Mirror the `chosen` (bool [B]) of the maps [B, ..., H, W] about an axis."""
    if images.ndim < 3:  # One number per frame, such as `Sensed.shift_m`, has no sides.
        return images
    chosen = chosen.to(images.device).reshape(-1, *[1] * (images.ndim - 1))
    return torch.where(chosen, images.flip(axis), images)


@dataclass(frozen=True)
class Order:
    """What one batch is asked to consist of; see `Source.batch`.

    Attributes
    ----------
    numbers : tuple of int
        Frames of the source.
    draw : int
        Which draw of the noise.
    shots : Shots or None
        Samples of each frame, or none.
    """

    numbers: tuple[int, ...]
    draw: int
    shots: Shots | None


class Acquired(Dataset):
    """Batches of a source, by their `Order`, as torch's data loaders want them."""

    def __init__(self, source: Source):
        self.source = source

    def __getitem__(self, order: Order) -> Batch:
        """Acquire one batch."""
        return self.source.batch(order.numbers, draw=order.draw, shots=order.shots)


class EpochShuffle(Sampler[Order]):
    """Batches of all frames in a new order each epoch, which depends on seed and epoch alone.

    Each epoch is another draw of the source, and each batch has one of the `shots`. Of processes
    that share the batches each has its own frames of them.
    """

    def __init__(
        self,
        frames: int,
        batch_size: int,
        shots: Sequence[Shots],
        seed: int,
        ranks: Ranks = ALONE,
    ):
        self.frames, self.batch_size, self.shots, self.seed = frames, batch_size, shots, seed
        self.ranks, self.epoch = ranks, 0

    def set_epoch(self, epoch: int) -> None:
        """Choose the order; the training loop calls this before each epoch."""
        self.epoch = epoch

    def __iter__(self) -> Iterator[Order]:
        """This epoch's batches, or what this process has of them."""
        # One stream for the order and then for each batch's samples: another batch size or choice
        # of samples deals the frames in the same order.
        generator = np.random.default_rng((self.seed, self.epoch))
        order = generator.permutation(self.frames).tolist()
        for start in range(0, self.frames, self.batch_size):
            shots = self.shots[int(generator.integers(len(self.shots)))] if self.shots else None
            numbers = tuple(self.ranks.own(order[start : start + self.batch_size]))
            # Draw 0 is what networks are validated and tested on (`JUDGED_DRAW`).
            yield Order(numbers, self.epoch + 1, shots)

    def __len__(self) -> int:
        """Number of batches, the last of which may be smaller."""
        return -(-self.frames // self.batch_size)


def in_order(source: Source, batch_size: int, shots: Sequence[Shots], *, draw: int) -> list[Order]:
    """Batches of all frames in their own order, for each of the `shots` (or none)."""
    numbers = range(len(source))
    return [
        Order(tuple(numbers[start : start + batch_size]), draw, count)
        for count in (shots or (None,))
        for start in range(0, len(source), batch_size)
    ]


def loader(
    source: Source, orders: Sampler[Order] | list[Order], *, threads: int = 0
) -> DataLoader | AcquiredAhead:
    """The batches of `source` in the given order, acquired when asked for or ahead by threads."""
    if threads:
        return AcquiredAhead(source, orders, threads)
    # No batch size: an `Order` is a whole batch already.
    return DataLoader(Acquired(source), batch_size=None, sampler=orders)


class AcquiredAhead:
    """Batches of a source in the given order, acquired ahead so that a GPU need not wait for them.

    By threads, since torch lets other threads run while it computes, and since processes forked
    beside a GPU are fragile. The batches lie in pinned memory, which the GPU copies from by itself.

    Parameters
    ----------
    source : Source
    sampler : sampler or list of Order
        What to acquire; a sampler is told of each epoch by the training loop.
    threads : int
        At least 1.
    """

    batch_sampler = None
    """None, which Lightning asks of a loader that has a `sampler`."""

    def __init__(self, source: Source, sampler: Sampler[Order] | list[Order], threads: int):
        self.sampler, self.threads, self._acquired = sampler, threads, Acquired(source)

    def __len__(self) -> int:
        """Number of batches."""
        return len(self.sampler)  # type: ignore[arg-type]

    def __iter__(self) -> Iterator[Batch]:
        """The batches; leaving the loop ends the threads."""
        # One torch thread in each, set by the pool's own threads as they start: frames side by side
        # are quicker than one operation spread over the cores.
        pool = ThreadPoolExecutor(self.threads, initializer=torch.set_num_threads, initargs=(1,))
        waiting: deque[Future[Batch]] = deque()
        try:
            for order in self.sampler:
                waiting.append(pool.submit(self._acquire, order))
                # One more than there are threads, so that none is idle while a batch is used.
                if len(waiting) > self.threads:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:  # Also where the caller leaves the loop early.
            pool.shutdown(cancel_futures=True)

    def _acquire(self, order: Order) -> Batch:
        batch = self._acquired[order]
        if not torch.cuda.is_available():
            return batch
        sensed, truth = batch
        return mapped(Tensor.pin_memory, sensed), mapped(Tensor.pin_memory, truth)


def training_device() -> torch.device:
    """Where networks are trained and judged: on a GPU where there is one."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def acquiring_threads(device: torch.device) -> int:
    """Threads that acquire frames ahead for a network on `device`.

    A GPU waits for as many cores as there are; on a processor the network itself needs them.
    """
    return 0 if device.type == "cpu" else max(1, torch.get_num_threads() - 1)
