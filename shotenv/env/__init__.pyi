from .drive_order import drive_seed as drive_seed
from .info import (
    INFO_ENTRIES as INFO_ENTRIES,
    INFO_KEYS as INFO_KEYS,
    family_names as family_names,
)
from .single import (
    MOShotScheduleEnv as MOShotScheduleEnv,
    ShotScheduleEnv as ShotScheduleEnv,
)
from .vector import (
    MOShotScheduleVectorEnv as MOShotScheduleVectorEnv,
    ShotScheduleVectorEnv as ShotScheduleVectorEnv,
)
from .window import Window as Window
