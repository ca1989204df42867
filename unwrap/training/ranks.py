"""Processes that train one network together: which of each batch is whose, and sums over all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor, distributed

from unwrap.networks import Draw
from unwrap.support import mapped

Item = TypeVar("Item")


@dataclass(frozen=True)
class Share:
    """Which frames of a batch a process has.

    Attributes
    ----------
    frames : int
        Of the whole batch.
    first, step : int
        Place of the process's first frame, and how far it is from there to each next one.
    """

    frames: int
    first: int = 0
    step: int = 1

    @property
    def places(self) -> slice:
        """Of the whole batch's frames the own ones."""
        return slice(self.first, None, self.step)

    def draw(self, generator: torch.Generator) -> Draw:
        """Random numbers for the own frames, as one process would draw them for the whole batch."""

        def numbers(*shape: int) -> Tensor:
            whole = torch.rand(self.frames, *shape, generator=generator, device=generator.device)
            return whole[self.places]

        return numbers


@dataclass(frozen=True)
class Ranks:
    """One of several processes, and what it does together with the others.

    Frames, and whole batches where nothing is learned, are dealt like cards: the first to the first
    process, the next to the next. What speaks of all processes waits for each of them.

    Attributes
    ----------
    rank : int
        Of this process, from 0 on.
    processes : int
        On all machines together.

    Examples
    --------
    >>> Ranks(1, 3).own("abcdefgh")
    'beh'
    >>> alone = Ranks()
    >>> alone.own([4, 5]), alone.total(7), alone.pooled([8])
    ([4, 5], 7, [8])
    """

    rank: int = 0
    processes: int = 1

    @property
    def alone(self) -> bool:
        """Whether there is no other."""
        return self.processes == 1

    def own(self, items: Sequence[Item]) -> Sequence[Item]:
        """This process's part of what is dealt."""
        return items[self.rank :: self.processes]

    def share(self, frames: int) -> Share:
        """This process's part of a batch."""
        return Share(frames, self.rank, self.processes)

    def total(self, number: int | Tensor) -> int | Tensor:
        """The sum of a number of each process, without a gradient."""
        if self.alone:
            return number
        summed = torch.as_tensor(number, device=_device()).detach().clone()
        distributed.all_reduce(summed)
        return summed

    def pooled(self, items: list[Item]) -> list[Item]:
        """The items of all processes, in the order in which they were dealt; tensors on the CPU."""
        if self.alone:
            return items
        dealt: list[list[Item]] = [[] for _ in range(self.processes)]
        distributed.all_gather_object(dealt, [mapped(Tensor.cpu, item) for item in items])
        return [hand[turn] for turn in range(len(dealt[0])) for hand in dealt if turn < len(hand)]


ALONE = Ranks()
"""A process that trains by itself."""


def _device() -> torch.device:
    """Where the tensors lie that processes exchange: NCCL takes those of GPUs alone."""
    on_gpus = distributed.get_backend() == "nccl"
    return torch.device("cuda" if on_gpus else "cpu")
