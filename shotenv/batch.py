"""Rows of batched values: frozen dataclasses whose fields are tensors (or such dataclasses)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import torch
from torch import Tensor

Batched = TypeVar("Batched")


def take(value: Batched, rows: Tensor) -> Batched:
    """The rows `rows` (int64 [b]) of every tensor in `value`."""
    return _mapped(lambda tensor: tensor.index_select(0, rows), value)


def put(value: Batched, rows: Tensor, new: Batched) -> Batched:
    """A copy of `value` in which the rows `rows` (int64 [b]) are those of `new`."""
    return _mapped(lambda tensor, other: tensor.index_copy(0, rows, other), value, new)


def concatenate(values: Sequence[Batched]) -> Batched:
    """One batch of all rows of `values`, in order."""
    return values[0] if len(values) == 1 else _mapped(lambda *parts: torch.cat(parts), *values)


def _mapped(function: Callable[..., Tensor], *values: Any) -> Any:
    """`function` of the corresponding tensors of `values`, which are of one type."""
    first = values[0]
    if isinstance(first, Tensor):
        return function(*values)
    fields = [field.name for field in dataclasses.fields(first)]
    return type(first)(
        **{name: _mapped(function, *(getattr(value, name) for value in values)) for name in fields}
    )
