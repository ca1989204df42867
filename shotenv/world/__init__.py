"""A seed becomes a world: geometry, materials, lights, motion. Knows no renderer.

What goes where, for who adds something:

- a **family** of scenes: its name in `shotenv/config/families.py` (held out or not), a file in
  `families/` with its `lay_out_...` function, and a row in `families/settings.py`;
- a **thing**: a function in the file of its kind in `things/`, marked `@meshes.thing`, and a place
  where it is drawn: a list such as `pavement_thing` in `families/traffic.py`. A thing that only a
  held-out family may show stands in that family's file instead;
- a **material**: a `Finish` in `geometry/materials.py`;
- a **lamp**: a thing with a glowing face (`Material.glowing`) and a `Lamp` at the same place in
  `Site.lamps`, as `put_street_lamps` in `families/traffic.py` does; the sun's and sky's light, and
  the ego's own head lights, are drawn in `geometry/lights.py`;
- what **weather** does to surfaces: `geometry/weather.py`;
- how the **ego** drives, and how roads bend: `ego.py`. Layouts are told along a straight road, x
  along it and y across; `Site` bends them when all is placed.

Every draw takes its numbers from one generator in a fixed order, so that a family and a seed give
the same world on every machine; whatever is added to a family gives it other worlds, and other
banks.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
