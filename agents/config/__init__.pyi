from .agent import AgentConfig as AgentConfig
from .demo import DemoConfig as DemoConfig
from .study_config import StudyConfig as StudyConfig
