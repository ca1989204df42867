"""What worlds are made of: meshes, materials, lights, weather, the site.

`model.py` is what renderers read; `meshes.py` has the primitives that things are built of;
`materials.py` the near-infrared albedos; `lights.py` sun, sky and head lights; `weather.py` wet and
snow; `motion.py`, `mover.py` and `gait.py` how things, wheels and limbs move; `speed.py` and
`vehicle.py` how a car drives; `site.py` the ground that is still free; `road.py` curves, and how a
site is bent along one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
