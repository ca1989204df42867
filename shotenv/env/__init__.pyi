from .single import ShotScheduleEnv as ShotScheduleEnv, drive_seed as drive_seed
from .vector import ShotScheduleVectorEnv as ShotScheduleVectorEnv
