"""Rows of batched values: frozen dataclasses whose fields are tensors (or such dataclasses)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TypeVar

import torch
from torch import Tensor

Batched = TypeVar("Batched")


def take(value: Batched, rows: Tensor) -> Batched:
    """The rows `rows` (int64 [b]) of every tensor in `value`."""
    if isinstance(value, Tensor):
        return value.index_select(0, rows)
    return _rebuilt(value, lambda name: take(getattr(value, name), rows))


def put(value: Batched, rows: Tensor, new: Batched) -> Batched:
    """A copy of `value` in which the rows `rows` (int64 [b]) are those of `new`."""
    if isinstance(value, Tensor):
        return value.index_copy(0, rows, new)
    return _rebuilt(value, lambda name: put(getattr(value, name), rows, getattr(new, name)))


def concatenate(values: Sequence[Batched]) -> Batched:
    """One batch of all rows of `values`, in order."""
    if len(values) == 1:
        return values[0]
    if isinstance(values[0], Tensor):
        return torch.cat(list(values))
    return _rebuilt(values[0], lambda name: concatenate([getattr(v, name) for v in values]))


def _rebuilt(value: Batched, of) -> Batched:
    return type(value)(**{field.name: of(field.name) for field in dataclasses.fields(value)})
