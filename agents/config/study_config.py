"""How policies are judged."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from unwrap.support import NonNegative, Section

MOST_DRIVES = 10**6
"""Assumed; already some years of a sensor at 10 Hz."""


def _rising(prices: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(sorted(set(prices)))


class StudyConfig(Section):
    """Evaluation: which drives, prices and rivals, and how many bootstrap draws."""

    split: Literal["test", "shift"] = Field(
        "test", description="clips that the drives are made of; shift: families never trained on"
    )
    drives: int = Field(
        24, ge=2, le=MOST_DRIVES, description="test drives, the same for every policy"
    )
    tuning_drives: int = Field(
        12, ge=2, le=MOST_DRIVES, description="validation drives that tune the rules"
    )
    seed: int = Field(1000, ge=0, le=2**62, description="seed of the first drive")
    # About geometric: from where nearly all that helps is taken to where 2 DCS nearly always are.
    prices: Annotated[tuple[NonNegative, ...], AfterValidator(_rising)] = Field(
        (0.01, 0.02, 0.04, 0.06, 0.09, 0.13, 0.2, 0.35),
        min_length=1,
        max_length=1000,
        description="prices of power at which fronts are played",
    )
    families: tuple[str, ...] = Field(
        ("cycle", "snr_threshold", "look_and_hold", "look_and_weigh"),
        description="policies of practice that are tuned at each price and played beside",
    )
    bootstrap_draws: int = Field(10_000, ge=100, le=10**7, description="resamples of each interval")
    confidence: float = Field(0.95, gt=0.5, lt=1.0, description="coverage of each interval")
