from .checked_export import (
    CALIBRATION_FRAMES as CALIBRATION_FRAMES,
    CHECKED_FRAMES as CHECKED_FRAMES,
    CheckedExport as CheckedExport,
    metadata_of as metadata_of,
    shots_of as shots_of,
)
from .export_frames import (
    ExportFrames as ExportFrames,
    made_up_frames as made_up_frames,
    sample_inputs as sample_inputs,
)
from .onnx_conversion import OPSET as OPSET
from .onnx_graph import Exported as Exported, exported_network as exported_network
