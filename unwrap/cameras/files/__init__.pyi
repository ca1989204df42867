from .binary_frames import BinaryFrames as BinaryFrames
from .camera_description import (
    AxesConfig as AxesConfig,
    CameraDescription as CameraDescription,
    LensConfig as LensConfig,
    SamplesConfig as SamplesConfig,
    WordsConfig as WordsConfig,
)
from .espros_hdf5 import GRAY as GRAY, EsprosFile as EsprosFile
from .espros_wire import (
    CELSIUS_K as CELSIUS_K,
    WIRE_HEADER as WIRE_HEADER,
    WireFrames as WireFrames,
)
from .kinect_hdf5 import KinectLog as KinectLog
from .plain_arrays import ArrayFrames as ArrayFrames
from .stored_frames import FrameSource as FrameSource, StoredFrames as StoredFrames
