"""Worlds to light: the only room that imports Mitsuba.

From the sensor inwards: `frame.py` gives what the sensor needs of one frame, `instants.py` says
when light is gathered for it, `lens.py` strays some of it. `integrator.py` walks the light paths,
and adds at each surface the light of `light.py` (sun, sky, lamps) and of the laser: `beam.py` has
its profile, `pinhole.py` puts it beside the camera, `laser_light.py` finds its ways,
`modulation.py` modulates it. `irradiance_filter.py` averages gray light over neighbours.
`sampling.py` draws random numbers, `surfaces` has what rays meet.
`stock.py` gives the same world to Mitsuba's own integrators, for tests and benchmarks.

Another passive light goes into `light.py`; another property of surfaces into `Mesh` of
`shotenv.world.geometry`, then `Faces` and `Hit` of `surfaces`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
