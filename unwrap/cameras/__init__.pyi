from .camera_depth import (
    camera_for as camera_for,
    correct_frames as correct_frames,
    sensor_of as sensor_of,
)
from .camera_frames import CameraFrames as CameraFrames, dropped_frames as dropped_frames
from .camera_recording import (
    CameraRecording as CameraRecording,
    open_camera_recording as open_camera_recording,
    turned as turned,
)
from .canonical import quadrature_order as quadrature_order
from .labelling import Labelling as Labelling, fitting as fitting, labellings as labellings
from .pixel_rays import rays_of as rays_of
from .recording_summary import Summary as Summary, summary_of as summary_of
from .stored_words import gray_of as gray_of, samples_of as samples_of
