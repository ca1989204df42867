"""Loops over pixels, compiled.

A chain of array operations walks through memory once for each; a loop that Numba compiles does the
whole chain in one walk, several times faster. Arithmetic keeps to the rules of IEEE 754, in the
order in which it is written: every processor gives the same numbers to the last bit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numba
import numpy as np
from numba.extending import register_jitable

if TYPE_CHECKING:  # Processes that render start without torch.
    from torch import Tensor

Function = TypeVar("Function", bound=Callable[..., Any])


def loop(function: Function) -> Function:
    """`function` compiled at its first call, and kept on disk for the next process.

    It runs on one thread without Python's lock. Beside arrays it should be given float32 numbers: a
    Python float would make the arithmetic float64. What it calls must stand in the same file, or
    changes there would not be noticed.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        return numba.njit(cache=True, **options)(function)
    except RuntimeError:  # There is no folder to keep it in.
        return numba.njit(**options)(function)


def inlined(function: Function) -> Function:
    """`function` of numbers, which compiled loops may call as well."""
    return register_jitable(inline="always")(function)


def array(tensor: Tensor, dtype: type | None = np.float32) -> np.ndarray:
    """The memory of `tensor` as a contiguous array; a copy where it is not, or of another type."""
    return np.ascontiguousarray(tensor.numpy(), dtype)


def array_of(value: Tensor | float, shape: Sequence[int]) -> np.ndarray:
    """A number, or a map that is common to several frames, as float32 of each pixel."""
    if isinstance(value, (int, float, np.number)):
        return np.full(shape, value, np.float32)
    return array(value if value.shape == shape else value.expand(shape))


def can_loop(*tensors: Tensor) -> bool:
    """Whether loops may work on `tensors`: float32 in memory, without gradients or a tracer."""
    import torch

    if torch.compiler.is_compiling() or torch.jit.is_tracing():
        return False
    return all(
        tensor.is_cpu and tensor.dtype == torch.float32 and not tensor.requires_grad
        for tensor in tensors
    )
