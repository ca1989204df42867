"""How policies are judged."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from unwrap.support import Section


class StudyConfig(Section):
    """Evaluation: which drives and how many bootstrap draws."""

    split: Literal["test", "shift"] = Field(
        "test", description="clips that the drives are made of; shift: families never trained on"
    )
    drives: int = Field(24, ge=2, description="test drives, the same for every policy")
    tuning_drives: int = Field(12, ge=2, description="validation drives that tune the rule")
    seed: int = Field(1000, ge=0, description="seed of the first drive")
    bootstrap_draws: int = Field(10_000, ge=100, description="resamples of each interval")
    confidence: float = Field(0.95, gt=0.5, lt=1.0, description="coverage of each interval")
