from .frame import (
    FrameRenderer as FrameRenderer,
    RenderedFrame as RenderedFrame,
    render_frame as render_frame,
)
from .instants import Instants as Instants, frame_instants as frame_instants
from .mitsuba_file import (
    Part as Part,
    SceneFileError as SceneFileError,
    file_within as file_within,
    parse_mitsuba as parse_mitsuba,
)
from .probes import nearest_face as nearest_face
from .stock import stock_path as stock_path, stock_scene as stock_scene
