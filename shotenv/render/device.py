"""Arrays on the device that kernels run on."""

from __future__ import annotations

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
