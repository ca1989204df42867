from .bank import (
    HIGHEST_SPEED_M_S as HIGHEST_SPEED_M_S,
    MOST_FRAMES as MOST_FRAMES,
    BankConfig as BankConfig,
    CameraConfig as CameraConfig,
    Storage as Storage,
    WorldConfig as WorldConfig,
)
from .emission import EmissionConfig as EmissionConfig
from .env import EnvConfig as EnvConfig, RewardConfig as RewardConfig
from .families import (
    TRAINING_FAMILIES as TRAINING_FAMILIES,
    Family as Family,
    Split as Split,
)
from .imported_names import imports_refused as imports_refused
from .keywords import env_config as env_config
from .laser import ROOM_K as ROOM_K, LaserConfig as LaserConfig
from .mounts import MountConfig as MountConfig
from .own_scene import (
    OWN as OWN,
    LightsConfig as LightsConfig,
    MaterialsConfig as MaterialsConfig,
    OwnClip as OwnClip,
    OwnSceneConfig as OwnSceneConfig,
    ScenePathConfig as ScenePathConfig,
    SurfaceConfig as SurfaceConfig,
)
from .reader import (
    ConfigError as ConfigError,
    configs_dir as configs_dir,
    find_config as find_config,
    in_plain_words as in_plain_words,
    merged as merged,
    one_sentence as one_sentence,
    read_config as read_config,
)
from .sensor import ACQUISITION_FIELDS as ACQUISITION_FIELDS, SensorConfig as SensorConfig
