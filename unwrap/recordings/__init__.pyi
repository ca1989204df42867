from .camera import Camera as Camera, camera_of as camera_of
from .depth_output import (
    Points as Points,
    refuse_overwriting as refuse_overwriting,
    write_frames as write_frames,
)
from .frame_correction import (
    CorrectedFrame as CorrectedFrame,
    correct_recording as correct_recording,
    require_valid as require_valid,
)
from .images import read_png_folder as read_png_folder
from .loading import (
    load_recording as load_recording,
    read_map as read_map,
    require_gray as require_gray,
    with_stored_offset as with_stored_offset,
)
from .network_choice import (
    frequency_warning as frequency_warning,
)
from .recording import (
    NoUsablePixelError as NoUsablePixelError,
    Recording as Recording,
    read_recording as read_recording,
)
