"""Scenes of one's own: files of triangles, materials, lights and ways to worlds.

own_bank.py      files that a command names to the configuration of a bank
own_world.py     that configuration to worlds
bodies.py        what readers find: bodies with their materials, and lights
mesh_files.py    readers of PLY, OBJ and STL, which refuse what is too large before it is read
glb_files.py     reader of GLB
xml_scenes.py    reader of Mitsuba's scenes; what has no counterpart here is refused by name
shapes.py        Mitsuba's spheres, cylinders, ... as triangles
ways.py          poses over time, or way points and speeds, to motions
way_checks.py    refuses ways through walls, out of closed bodies, and too fast ones
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
