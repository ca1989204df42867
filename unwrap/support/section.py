"""What every section of the configuration is made of."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Range = tuple[float, float]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class Section(BaseModel):
    """Base of every section: frozen, and unknown keys are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


def check_range(name: str, bounds: Range) -> None:
    """Raise ValueError unless `bounds` is (low, high) with low <= high."""
    low, high = bounds
    if not low <= high:
        raise ValueError(f"{name} is ({low:g}, {high:g}); expected low <= high")
