from .camera import Camera as Camera, camera_of as camera_of
from .depth_output import (
    Points as Points,
    refuse_overwriting as refuse_overwriting,
    write_frames as write_frames,
)
from .frame_correction import (
    CorrectedFrame as CorrectedFrame,
    correct_recording as correct_recording,
)
from .loading import load_recording as load_recording
from .recording import (
    NoUsablePixelError as NoUsablePixelError,
    Recording as Recording,
    read_recording as read_recording,
)
