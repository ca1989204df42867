"""A cache of maps that is bounded by memory, whatever the size of the images."""

from __future__ import annotations

import dataclasses
from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Any, Generic, TypeVar

from torch import Tensor

Value = TypeVar("Value")


class MapCache(Generic[Value]):
    """Remembers what a function made of its arguments, as long as there is room.

    It belongs to the object that made it and goes with it. Threads may share it: where two ask for
    the same at once both may compute it, with the same result.

    Parameters
    ----------
    compute : callable
        Gives a tensor, or a tuple or a dataclass of such; its arguments are hashable.
    largest_mb : float
        The values used longest ago are given up where all together would be larger, in 10^6 bytes.

    Examples
    --------
    >>> import torch
    >>> zeros = MapCache(torch.zeros, largest_mb=0.009)  # room for two of 4000 bytes
    >>> first = zeros(1000)
    >>> zeros(1000) is first
    True
    >>> [len(zeros(size)) for size in (1001, 1002)]
    [1001, 1002]
    >>> zeros(1000) is first
    False
    """

    def __init__(self, compute: Callable[..., Value], *, largest_mb: float) -> None:
        self._compute, self._largest_bytes = compute, largest_mb * 1e6
        self._values: OrderedDict[tuple[Hashable, ...], Value] = OrderedDict()
        self._lock = Lock()
        self.nbytes = 0

    def __call__(self, *arguments: Hashable) -> Value:
        """The function's value, computed now unless it is remembered."""
        with self._lock:
            if arguments in self._values:
                self._values.move_to_end(arguments)
                return self._values[arguments]
        # Without the lock, so that threads compute side by side.
        value = self._compute(*arguments)
        with self._lock:
            if arguments not in self._values:
                self._values[arguments] = value
                self.nbytes += nbytes_of(value)
            # Down to nothing where a single value is larger than all the room.
            while self.nbytes > self._largest_bytes:
                _, oldest = self._values.popitem(last=False)
                self.nbytes -= nbytes_of(oldest)
        return value


def nbytes_of(value: Any) -> int:
    """Bytes of all tensors in `value`: a tensor, or a tuple or a dataclass of such values."""
    if isinstance(value, Tensor):
        return value.nbytes
    if isinstance(value, tuple):
        return sum(nbytes_of(part) for part in value)
    if dataclasses.is_dataclass(value):
        return sum(nbytes_of(getattr(value, field.name)) for field in dataclasses.fields(value))
    return 0
