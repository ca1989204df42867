"""Arrays of a bank's clips, opened when asked for: memory-mapped, or unpacked frame by frame."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Collection, Sequence
from pathlib import Path
from threading import Lock
from typing import Generic, TypeVar

import numpy as np
import torch
from torch import Tensor

from shotenv.bank.files import ARRAYS, PackedArray, array_file

Opened = TypeVar("Opened")
OPEN_CLIPS = 128
"""Clips of a bank that are open at a time: with five arrays each, 640 of the usual 1024 files."""


class ClipArrays(ABC, Generic[Opened]):
    """Arrays of a bank's clips, opened when asked for; the longest unused are closed.

    Every open array holds a file descriptor, and a bank may have more of them than a process may
    open. Threads may share it.

    Parameters
    ----------
    folders
        Of the clips, in their order.
    names
        Of the arrays.
    most
        Clips open at a time.
    """

    def __init__(
        self, folders: Sequence[Path], names: Collection[str] = ARRAYS, *, most: int = OPEN_CLIPS
    ) -> None:
        self._folders, self._names, self._most = tuple(folders), tuple(names), most
        self._open: OrderedDict[int, dict[str, Opened]] = OrderedDict()
        self._lock = Lock()

    def __getitem__(self, clip: int) -> dict[str, Opened]:
        """Arrays of clip number `clip` by name."""
        with self._lock:
            if clip not in self._open:
                folder = self._folders[clip]
                self._open[clip] = {name: self._opened(folder, name) for name in self._names}
                if len(self._open) > self._most:
                    self._open.popitem(last=False)
            self._open.move_to_end(clip)  # The one unused for longest comes first.
            return self._open[clip]

    @abstractmethod
    def frame(self, clip: int, name: str, number: int) -> Tensor:
        """Frame `number` of an array of a clip, [1, channels..., H, W]."""

    @abstractmethod
    def _opened(self, folder: Path, name: str) -> Opened:
        """An array of the clip in a folder."""


class MappedClips(ClipArrays[Tensor]):
    """Arrays as they are in memory, mapped, frames first; a frame is a view of its file."""

    def frame(self, clip: int, name: str, number: int) -> Tensor:
        """See `ClipArrays.frame`."""
        return self[clip][name].narrow(0, number, 1)

    def _opened(self, folder: Path, name: str) -> Tensor:
        # Copy-on-write: torch wants a writable array, and the file is never written to.
        return torch.from_numpy(np.load(folder / f"{name}.npy", mmap_mode="c", allow_pickle=False))


class PackedClips(ClipArrays[PackedArray]):
    """Arrays of which each frame is packed on its own.

    Parameters
    ----------
    folders
        Of the clips, in their order.
    size
        Height and width.
    """

    def __init__(self, folders: Sequence[Path], size: tuple[int, int]) -> None:
        super().__init__(folders)
        self._size = size

    def frame(self, clip: int, name: str, number: int) -> Tensor:
        """See `ClipArrays.frame`."""
        return self[clip][name].frame(number).unsqueeze(0)

    def _opened(self, folder: Path, name: str) -> PackedArray:
        shape = (*ARRAYS[name].channels, *self._size)
        return PackedArray(folder / array_file(name, "float16"), name, shape)
