from .arguments import (
    ACTIONS as ACTIONS,
    check_action as check_action,
    feature_space as feature_space,
    term_space as term_space,
)
from .drive_order import drive_seed as drive_seed
from .info import (
    INFO_ENTRIES as INFO_ENTRIES,
    INFO_KEYS as INFO_KEYS,
    family_codes as family_codes,
    family_names as family_names,
    info_columns as info_columns,
    info_of as info_of,
)
from .reset_options import (
    COLDEST_K as COLDEST_K,
    check_number as check_number,
    check_options as check_options,
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
