from .agent import AgentConfig as AgentConfig
from .demo import DemoConfig as DemoConfig
from .study import StudyConfig as StudyConfig
