from .binary_frames import BinaryFrames as BinaryFrames
from .camera_description import (
    AxesConfig as AxesConfig,
    CameraDescription as CameraDescription,
    LensConfig as LensConfig,
    SamplesConfig as SamplesConfig,
    WordsConfig as WordsConfig,
)
from .espros_hdf5 import (
    FRAMES as FRAMES,
    GRAY as GRAY,
    SAMPLES as SAMPLES,
    TIMES as TIMES,
    EsprosFile as EsprosFile,
)
from .espros_wire import (
    CELSIUS_K as CELSIUS_K,
    WIRE_HEADER as WIRE_HEADER,
    WireFrames as WireFrames,
)
from .kinect_hdf5 import (
    IMAGE_BYTES as IMAGE_BYTES,
    IMAGES as IMAGES,
    SATURATED as SATURATED,
    KinectLog as KinectLog,
    expanded as expanded,
    stored_places as stored_places,
)
from .plain_arrays import PER_FRAME as PER_FRAME, ArrayFrames as ArrayFrames
from .stored_frames import FrameSource as FrameSource, StoredFrames as StoredFrames
