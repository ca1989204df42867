from .bank import Bank as Bank, open_bank as open_bank
from .config import EnvConfig as EnvConfig, env_config as env_config
from .env import (
    ShotScheduleEnv as ShotScheduleEnv,
    ShotScheduleVectorEnv as ShotScheduleVectorEnv,
)
from .sensor import expose as expose

ENV_ID: str
IMAGE_ENV_ID: str
MO_ENV_ID: str
