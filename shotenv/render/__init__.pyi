from .frame import (
    FrameRenderer as FrameRenderer,
    RenderedFrame as RenderedFrame,
    render_frame as render_frame,
)
from .instants import Instants as Instants, frame_instants as frame_instants
from .stock import stock_path as stock_path, stock_scene as stock_scene
