"""The frames that methods are compared on, as far as the comparison looks at them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from torch import Tensor

from unwrap.signal import Memory
from unwrap.training import Source, TrainConfig


class ComparedFrames(Source, Protocol):
    """A source of training that knows its pixels' worth and how its frames follow each other."""

    @property
    def held_out_families(self) -> Sequence[str]:
        """Kinds of scene that no training sees; the split "shift" is there where there are any."""
        ...

    def scored(self, numbers: Sequence[int], *, draw: int) -> Tensor:
        """Pixels that count in frames `numbers`, bool [B, H, W], the same for all methods."""
        ...

    def follows(self, number: int) -> bool:
        """Whether frame `number` comes right after frame `number - 1` in one clip."""
        ...

    def warp(self, distance_m: Tensor, numbers: Sequence[int]) -> Memory:
        """Distances [B, H, W] of the frames before, as frames `numbers` would see them."""
        ...


OpenSplits = Callable[[TrainConfig], Callable[[str], ComparedFrames]]
"""Gives, for a training, the frames of a split by its name: "train", "validation", "test" and,
where there are held-out families, "shift"."""
