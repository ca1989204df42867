"""Worlds to noise-free light: the only room that imports Mitsuba, and not before it must.

`FrameRenderer` gives what the sensor needs of the frames of a world, `render_frame` of one;
`shotenv.render.integrator.trace` is the integrator underneath; `run_jobs` renders in worker
processes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
