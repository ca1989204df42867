"""Arguments of public functions: another kind, type or size is refused by the argument's name."""

from __future__ import annotations

import numbers
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from unwrap.support.error_text import in_short

if TYPE_CHECKING:
    from torch import Tensor


def require_floats(*, alike: bool = False, **values: Any) -> None:
    """Raise TypeError unless all are tensors, ValueError unless of floats (and one shape).

    Examples
    --------
    >>> require_floats(gray=[0.5])
    Traceback (most recent call last):
    ...
    TypeError: gray is list; expected a torch tensor
    """
    import torch  # Not at the top: the configuration is checked without it.

    shapes = {}
    for name, value in values.items():
        if not isinstance(value, torch.Tensor):
            raise TypeError(f"{name} is {type(value).__name__}; expected a torch tensor")
        if not value.is_floating_point():
            raise ValueError(f"{name} is {value.dtype}; expected floating-point numbers")
        shapes[name] = tuple(value.shape)
    if alike and len(set(shapes.values())) > 1:
        told = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
        raise ValueError(f"shapes differ: {told}; expected one shape")


def require_positive(**values: Any) -> None:
    """Raise TypeError unless all are numbers, ValueError unless they lie within 1e-15..1e15.

    What is outside is no frequency in hertz and no distance in metres, and overflows in float32.
    """
    for name, value in values.items():
        if not isinstance(value, numbers.Real) or isinstance(value, bool):
            raise TypeError(f"{name} is {type(value).__name__}; expected a number")
        if not 1e-15 <= value <= 1e15:  # type: ignore[operator]
            raise ValueError(
                f"{name} is {in_short(value)}; expected a positive number, 1e-15..1e15"
            )


def require_not_negative(**values: Tensor | float) -> None:
    """Raise ValueError unless all numbers, or those of tensors, are at least 0; NaN is refused."""
    import torch

    for name, value in values.items():
        if isinstance(value, torch.Tensor):
            require_floats(alike=False, **{name: value})
            good = not value.numel() or bool(value.amin() >= 0)
        elif not isinstance(value, numbers.Real) or isinstance(value, bool):
            raise TypeError(
                f"{name} is {type(value).__name__}; expected a number or a torch tensor"
            )
        else:
            good = value >= 0
        if not good:
            raise ValueError(f"{name} is negative or NaN; expected at least 0")


def require_path(**values: Any) -> None:
    """Raise TypeError unless all are paths, or names as strings."""
    for name, value in values.items():
        if not isinstance(value, str | Path):
            raise TypeError(f"{name} is {type(value).__name__}; expected a path")


def require_choice(known: Collection[str], **values: Any) -> None:
    """Raise ValueError unless all are one of the words `known`.

    Examples
    --------
    >>> require_choice(("nearest", "floor"), merge=None)
    Traceback (most recent call last):
    ...
    ValueError: merge is None; expected one of nearest, floor
    """
    for name, value in values.items():
        if not isinstance(value, str) or value not in known:
            raise ValueError(f"{name} is {in_short(value)}; expected one of {', '.join(known)}")
