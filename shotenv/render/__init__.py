"""Worlds to noise-free light: the only room that imports Mitsuba, and not before it must.

`FrameRenderer` gives what the sensor needs of the frames of a world, `render_frame` of one;
`shotenv.render.integrator.trace` is the integrator underneath; `run_jobs` renders in worker
processes.
"""

from shotenv.render.frame import FrameRenderer, RenderedFrame, render_frame
from shotenv.render.instants import Instants, frame_instants
from shotenv.render.llvm import RendererError, find_llvm, require_device, require_llvm

__all__ = [
    "FrameRenderer",
    "Instants",
    "RenderedFrame",
    "RendererError",
    "find_llvm",
    "frame_instants",
    "render_frame",
    "require_device",
    "require_llvm",
]
