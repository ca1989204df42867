"""What a whole study plays: policies, presets, training seeds, ablations, and transfer."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, StringConstraints, model_validator

from agents.config.study_config import StudyConfig
from unwrap.support import Section

Name = Annotated[str, StringConstraints(pattern=r"^[a-z0-9_]+$")]
"""Of a row or a table; it is that of files, too."""
Played = Literal["all"] | tuple[str, ...]


def _all_on_each(presets: object) -> object:
    """A list of presets as the mapping that plays all policies on each."""
    return dict.fromkeys(presets, "all") if isinstance(presets, list | tuple) else presets


class AblationConfig(Section):
    """A learner that is not shown some features, or is trained with other settings."""

    policy: str = Field(description="name in configs/agent, or the path of its YAML file")
    unseen: tuple[str, ...] = Field(
        (), description="features that it is not shown, in training and in play; regression alone"
    )
    agent: dict[str, Any] = Field(
        default_factory=dict,
        description="settings that differ from its file's, such as regression: {horizon: 1}",
    )
    presets: tuple[str, ...] = Field(("default",), min_length=1, description="where it is played")

    @model_validator(mode="after")
    def _changes_something(self) -> Self:
        if not (self.unseen or self.agent):
            raise ValueError("unseen and agent are empty; expected what differs from the policy")
        return self


class TransferTable(Section):
    """Drives of another kind than those of the training."""

    preset: str = Field("default", description="name in configs/env, or the path of a YAML file")
    split: Literal["test", "shift"] | None = Field(
        None, description="clips that the drives are made of; none: those of the study"
    )
    env: dict[str, Any] = Field(
        default_factory=dict,
        description="settings that differ from the preset's, such as "
        "sensor: {integration_s: [1.0e-4, 1.0e-4]}",
    )


class TransferConfig(Section):
    """Policies that are trained and tuned on one preset, and played elsewhere as they are.

    Attributes
    ----------
    tables : dict of str to TransferTable
        By their names, which no preset has.
    """

    source: str = Field("default", description="preset that they are trained and tuned on")
    policies: tuple[str, ...] = Field(
        min_length=1, description="those of the source that are played, or its ablations"
    )
    tables: dict[Name, TransferTable] = Field(min_length=1, description="where they are played")


class StudyPlan(Section):
    """What `shotenv study` is told.

    Attributes
    ----------
    ablations : dict of str to AblationConfig
        By the name that their row has.
    transfer : TransferConfig, optional
        What is played elsewhere, without training anew.
    study : StudyConfig
        Drives, prices and intervals; its families do not count, `policies` does.
    """

    policies: tuple[str, ...] = Field(
        min_length=1,
        description="learners (names in configs/agent, or YAML files), policies of practice, "
        "random, and folders of trained schedulers",
    )
    presets: Annotated[dict[str, Played], BeforeValidator(_all_on_each)] = Field(
        min_length=1,
        description="names in configs/env, or YAML files; a list has all policies trained and "
        "played on each of them, a mapping tells which, as in {default: all, hot: [regression]}",
    )
    seeds: tuple[int, ...] = Field(min_length=1, description="seeds of the training")
    ablations: dict[Name, AblationConfig] = Field(
        default_factory=dict, description="learners that are not shown or told all"
    )
    transfer: TransferConfig | None = None
    study: StudyConfig = StudyConfig()
