"""Loops over pixels, compiled by Numba.

A chain of array operations reads and writes memory once for each operation; a compiled loop does
the whole chain in one pass, several times faster. Arithmetic keeps to the rules of IEEE 754, in the
order in which it is written (no `fastmath`): every processor gives the same numbers to the last
bit.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
import pickle
import zlib
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numba
import numpy as np
from numba.core.caching import FunctionCache
from numba.core.serialize import dumps
from numba.extending import register_jitable

from unwrap.support.files import write_bytes

if TYPE_CHECKING:  # Processes that render start without torch.
    from torch import Tensor

ONE_ROW = 1024
"""Most pixels that a loop takes as one row."""

Function = TypeVar("Function", bound=Callable[..., Any])


def loop(function: Function) -> Function:
    """`function` compiled at its first call; the machine code is kept on disk for later processes.

    It runs on one thread, without Python's lock. Numbers beside the arrays should be `np.float32`:
    a Python float would make the arithmetic float64. Functions that it calls must stand in the same
    file: Numba compiles anew when that file changes, and does not look at others.

    Examples
    --------
    >>> @loop
    ... def add_(values, number):
    ...     for i in range(len(values)):
    ...         values[i] += number
    >>> values = np.zeros(3, np.float32)
    >>> add_(values, np.float32(2))
    >>> values
    array([2., 2., 2.], dtype=float32)
    """
    # With Python's error model a division by zero raises, and every division is preceded by a test.
    compiled: Any = numba.njit(nogil=True, error_model="numpy")(function)
    # Where no folder can be written to: installed read-only, without a home.
    with contextlib.suppress(RuntimeError):
        compiled._cache = CodeCache(function)
    return compiled


class CodeCache(FunctionCache):
    """Numba's cache of the machine code of a function, in `CodeFiles`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        # A number of its own for each version of the file in which the function stands.
        version = self._impl.locator.get_source_stamp()
        self._cache_file: Any = CodeFiles(Path(self.cache_path), self._impl.filename_base, version)


class CodeFiles:
    """Machine code of a function on disk: a file for each kind of arguments, known by its name.

    Numba's own has an index of numbered files. A process that is killed after it wrote the index,
    or reads between that of another and the file, takes what an earlier version of the function was
    compiled to; and an index that names a class which has moved since cannot be read at all.

    Parameters
    ----------
    folder : Path
    stem : str
        What names of the function's files begin with.
    version : object
        Of the function's source.
    """

    def __init__(self, folder: Path, stem: str, version: object) -> None:
        self._folder, self._stem = folder, stem
        self._version = _digest((numba.__version__, version))

    def load(self, key: object) -> Any:
        """What was kept for `key`; None where there is nothing that is of any use."""
        try:
            return pickle.loads(self._path(key).read_bytes())
        # Missing, damaged, or of classes that have moved: whatever it is, it is compiled anew.
        except Exception:
            return None

    def save(self, key: object, data: object) -> None:
        """Keep `data`, and nothing of other versions; a disk that is full keeps nothing."""
        with contextlib.suppress(OSError):
            for path in self._folder.glob(f"{self._stem}.*.nbc"):
                if not path.name.startswith(f"{self._stem}.{self._version}"):
                    path.unlink(missing_ok=True)
            write_bytes(self._path(key), dumps(data))

    def flush(self) -> None:
        """Nothing is remembered here."""

    def _path(self, key: object) -> Path:
        return self._folder / f"{self._stem}.{self._version}.{_digest(key)}.nbc"


def _digest(told: object) -> str:
    return hashlib.sha256(repr(told).encode()).hexdigest()[:16]


def in_parts(function: Callable[[int, int], Any], count: int, *, least: int) -> list[Any]:
    """`function` of (begin, end) for parts of 0..count, side by side on torch's number of threads.

    It should be a compiled loop, which leaves Python to others, over things that do not depend on
    each other: then the parts make no difference to the numbers.

    Parameters
    ----------
    least : int
        Fewest that are worth a thread.

    Examples
    --------
    >>> in_parts(lambda begin, end: (begin, end), 3, least=5)
    [(0, 3)]
    """
    import torch  # Not at the top: see above.

    threads = max(min(torch.get_num_threads(), count // least), 1)
    ends = [count * (part + 1) // threads for part in range(threads)]
    if threads == 1:
        return [function(0, count)]
    pool = _pool(os.getpid(), threads - 1)
    others = [pool.submit(function, *part) for part in pairwise(ends)]
    return [function(0, ends[0]), *(other.result() for other in others)]


@lru_cache(maxsize=2)
def _pool(process: int, threads: int) -> ThreadPoolExecutor:
    # By the process, for threads do not live on in one that is forked.
    return ThreadPoolExecutor(threads, thread_name_prefix="shotenv")


def source_stamp(*loops: Any) -> int:
    """Number that changes with the files in which `loops` stand, for a loop that calls them.

    As a variable of the enclosing function it is part of what Numba knows a loop by, and machine
    code kept for former files is not taken for that of the present ones.
    """
    files = sorted({inspect.getfile(one.py_func) for one in loops})
    return zlib.crc32(b"".join(Path(file).read_bytes() for file in files))


def inlined(function: Function) -> Function:
    """`function` of numbers, which Python calls as it is and compiled loops inline."""
    return register_jitable(inline="always")(function)


def array(tensor: Tensor, dtype: type | None = np.float32) -> np.ndarray:
    """The memory of `tensor` as a contiguous array; a copy where it is not, or of another type."""
    return np.ascontiguousarray(tensor.numpy(), dtype)


def long_rows(maps: np.ndarray, most: int = ONE_ROW) -> np.ndarray:
    """Contiguous maps [..., H, W] for a loop over rows, several short rows being taken as one.

    For loops that do not ask for rows: what comes before and after the vector instructions of a
    loop is a large part of a short row. A row has at most `most` pixels, or is left as it is.

    Examples
    --------
    >>> long_rows(np.zeros((64, 15, 20))).shape, long_rows(np.zeros((64, 15, 20)), 64).shape
    ((64, 1, 300), (64, 5, 60))
    >>> long_rows(np.zeros((1, 120, 160)), 64).shape
    (1, 120, 160)
    """
    *leading, height, width = maps.shape
    together = next((n for n in range(height, 1, -1) if height % n == 0 and n * width <= most), 1)
    return maps.reshape(*leading, height // together, width * together)


def array_of(value: Tensor | float, shape: Sequence[int]) -> np.ndarray:
    """A number, or a map that is common to several frames, as a float32 array of `shape`.

    Examples
    --------
    >>> array_of(1.5, (2, 2))
    array([[1.5, 1.5],
           [1.5, 1.5]], dtype=float32)
    """
    if isinstance(value, (int, float, np.number)):
        return np.full(shape, value, np.float32)
    return array(value if value.shape == shape else value.expand(shape))


def can_loop(*tensors: Tensor) -> bool:
    """Whether loops may work on `tensors`: float32 on the processor, without gradients.

    False, too, while torch records a graph (compilation, tracing for ONNX or OpenVINO), in which a
    loop would leave no trace.
    """
    import torch  # Not at the top: see above.

    if torch.compiler.is_compiling() or torch.jit.is_tracing():
        return False
    return all(
        tensor.is_cpu and tensor.dtype == torch.float32 and not tensor.requires_grad
        for tensor in tensors
    )
