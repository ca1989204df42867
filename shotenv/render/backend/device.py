"""Arrays on the device that kernels run on."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np


def upload(values: np.ndarray) -> Any:
    """A flat copy of `values` as `mi.Float`.

    A copy, because `mi.Float(values)` borrows NumPy's memory, whose alignment decides which
    gather instructions Dr.Jit emits: the kernel would be compiled anew for some worlds.
    """
    return dr.opaque(mi.Float(np.ascontiguousarray(values, dtype=np.float32).ravel()))


def only_where(active: Any, compute: Callable[[], Any]) -> Any:
    """`compute()`, a float, in lanes that are `active`, and 0 elsewhere.

    Where no lane of those that a processor handles at once is active, it skips the work; lanes
    that are merely masked cost it nearly as much as others.
    """
    return dr.if_stmt((), active, compute, lambda: mi.Float(0))
