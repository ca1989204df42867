"""Values of several tensors: tuples of them, and dataclasses whose fields are such values."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import torch
from torch import Tensor

Value = TypeVar("Value")


def mapped(function: Callable[..., Tensor], value: Value, *others: Value) -> Value:
    """`value` with every tensor replaced by `function` of it and of its peers in `others`.

    What is neither a tensor, a tuple nor a dataclass stays as it is.

    Examples
    --------
    >>> pair = (torch.tensor([1.0]), (torch.tensor([2.0]), "as it is"))
    >>> mapped(lambda tensor: 10 * tensor, pair)
    (tensor([10.]), (tensor([20.]), 'as it is'))
    """
    if isinstance(value, Tensor):
        return function(value, *others)  # type: ignore[return-value]
    if isinstance(value, tuple):
        return tuple(mapped(function, *parts) for parts in zip(value, *others, strict=True))  # type: ignore[return-value]
    # `is_dataclass` also says yes to the class itself, which has no values.
    if not dataclasses.is_dataclass(value) or isinstance(value, type):
        return value
    parts: dict[str, Any] = {
        field.name: mapped(function, *(getattr(one, field.name) for one in (value, *others)))
        for field in dataclasses.fields(value)
    }
    return type(value)(**parts)  # type: ignore[return-value]


def on_device(value: Value, device: torch.device) -> Value:
    """`value` on `device`; from pinned memory without waiting."""
    return mapped(lambda tensor: tensor.to(device, non_blocking=True), value)


def take(value: Value, rows: Tensor) -> Value:
    """The rows `rows` (int64 [b]) of every tensor in `value`."""
    return mapped(lambda tensor: tensor.index_select(0, rows), value)


def put(value: Value, rows: Tensor, new: Value) -> Value:
    """A copy of `value` in which the rows `rows` (int64 [b]) are those of `new`."""
    return mapped(lambda tensor, other: tensor.index_copy(0, rows, other), value, new)


def concatenate(values: Sequence[Value]) -> Value:
    """One batch of all rows of `values`, in order; a single value is returned as it is."""
    if len(values) == 1:
        return values[0]
    return mapped(lambda *parts: torch.cat(parts), *values)
