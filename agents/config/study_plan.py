"""What a whole study plays: policies, presets, training seeds and what learners are not shown."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, StringConstraints

from agents.config.study_config import StudyConfig
from unwrap.support import Section

RowName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]+$")]
"""It is that of files, too."""


class AblationConfig(Section):
    """A learner that is not shown some features, in training and in play."""

    policy: str = Field(description="regression in configs/agent, or the path of its YAML file")
    unseen: tuple[str, ...] = Field(min_length=1, description="features that it is not shown")
    presets: tuple[str, ...] = Field(("default",), min_length=1, description="where it is played")


class StudyPlan(Section):
    """What `shotenv study` is told.

    Attributes
    ----------
    ablations : dict of str to AblationConfig
        By the name that their row has.
    study : StudyConfig
        Drives, prices and intervals; its families do not count, `policies` does.
    """

    policies: tuple[str, ...] = Field(
        min_length=1,
        description="learners (names in configs/agent, or YAML files), policies of practice, "
        "random, and folders of trained schedulers",
    )
    presets: tuple[str, ...] = Field(
        min_length=1, description="names in configs/env, or YAML files"
    )
    seeds: tuple[int, ...] = Field(min_length=1, description="seeds of the training")
    ablations: dict[RowName, AblationConfig] = Field(
        default_factory=dict, description="learners that are not shown all features"
    )
    study: StudyConfig = StudyConfig()
