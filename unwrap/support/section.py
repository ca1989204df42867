"""Sections of the configuration: their base class, and types of bounded numbers."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Range = tuple[float, float]
"""(low, high), see `check_range`."""
LARGEST = 1e12
"""Of any quantity that a configuration tells, in its unit; its inverse is the smallest above 0. No
slip of the decimal point lies beyond, and products of such numbers are finite in float32."""


def _of_sensible_size(value: float) -> float:
    # Not as `le` of a field, which would win over the closer limit of a field of this type.
    if value and not 1 / LARGEST <= value <= LARGEST:
        raise ValueError(f"expected a number of {1 / LARGEST:g} to {LARGEST:g}")
    return value


Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False), AfterValidator(_of_sensible_size)]
NonNegative = Annotated[
    float, Field(ge=0.0, allow_inf_nan=False), AfterValidator(_of_sensible_size)
]


class Section(BaseModel):
    """Base of every section: frozen, and unknown keys are refused.

    Examples
    --------
    >>> class Lens(Section):
    ...     f_number: Positive = 1.4
    >>> Lens(f_numbre=2)
    Traceback (most recent call last):
    ...
    pydantic_core._pydantic_core.ValidationError: 1 validation error for Lens
    ...
    """

    model_config = ConfigDict(frozen=True, extra="forbid")


def check_range(name: str, bounds: Range) -> None:
    """Raise ValueError unless `bounds` is (low, high) with low <= high."""
    low, high = bounds
    # Not `low > high`, which is false for NaN.
    if not low <= high:
        raise ValueError(f"{name} is ({low:g}, {high:g}); expected low <= high")
