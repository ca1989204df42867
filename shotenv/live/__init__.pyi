from .epc_camera import EpcCamera as EpcCamera
from .live_bank import Ego as Ego, LiveBank as LiveBank
from .live_camera import (
    Camera as Camera,
    CameraDisconnectedError as CameraDisconnectedError,
    CameraError as CameraError,
    CameraTimeoutError as CameraTimeoutError,
    DamagedFrameError as DamagedFrameError,
    GrayFrame as GrayFrame,
    Samples as Samples,
    StaleFrameError as StaleFrameError,
    TruncatedFrameError as TruncatedFrameError,
)
from .live_env import FrameTimes as FrameTimes, LiveShotScheduleEnv as LiveShotScheduleEnv
