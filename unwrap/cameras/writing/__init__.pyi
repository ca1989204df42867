from .recording_files import (
    WrittenFiles as WrittenFiles,
    container_of as container_of,
    write_camera_recording as write_camera_recording,
)
from .stored_planes import kept_frequencies as kept_frequencies, stored_frames as stored_frames
