"""The whole experiment: environment, scheduler and judgement."""

from __future__ import annotations

from agents.config.agent import AgentConfig
from agents.config.study_config import StudyConfig
from shotenv.config import EnvConfig
from unwrap.support import Section


class DemoConfig(Section):
    """What `shotenv demo` and its parts are told.

    Attributes
    ----------
    env : EnvConfig
        Bank, sensor, laser and reward.
    agent : AgentConfig
        Training of the scheduler.
    study : StudyConfig
        Drives that it is judged on.
    """

    env: EnvConfig
    agent: AgentConfig
    study: StudyConfig
