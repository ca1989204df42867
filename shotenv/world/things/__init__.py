"""Things that stand, drive and walk in worlds.

Each is a function of a generator that returns a mesh standing on z = 0 and facing +x, or a `Mover`
where wheels turn or limbs swing (its `at_rest` is the mesh for what is parked), marked
`@meshes.thing`: its name becomes the kind of its faces (`World.kinds`). A new one goes into the
file of its kind, and into a list that it is drawn from: `traffic` and `parked_car` in
`vehicles.py`, `somebody` in `people.py`, `tree` and `shrub` in `plants.py`, `roadside_thing` and
`pavement_thing` in `families/traffic.py`. Sizes are those of usual products and people, in metres;
how often a kind or a colour comes is assumed.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
