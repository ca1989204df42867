from .agent import (
    MOST_HIDDEN as MOST_HIDDEN,
    WIDEST as WIDEST,
    AgentConfig as AgentConfig,
    DqnConfig as DqnConfig,
    PpoConfig as PpoConfig,
    RecurrentConfig as RecurrentConfig,
    RegressionConfig as RegressionConfig,
)
from .demo import DemoConfig as DemoConfig
from .study_config import StudyConfig as StudyConfig
from .study_plan import (
    AblationConfig as AblationConfig,
    StudyPlan as StudyPlan,
    TransferConfig as TransferConfig,
    TransferTable as TransferTable,
)
