from .frame import (
    FrameRenderer as FrameRenderer,
    RenderedFrame as RenderedFrame,
    render_frame as render_frame,
)
from .instants import Instants as Instants, frame_instants as frame_instants
