"""TODO."""

from __future__ import annotations

from agents.config.agent import AgentConfig
from agents.config.study_config import StudyConfig
from shotenv.config import EnvConfig
from unwrap.support import Section


class DemoConfig(Section):
    """The main job, small."""

    env: EnvConfig
    agent: AgentConfig
    study: StudyConfig
