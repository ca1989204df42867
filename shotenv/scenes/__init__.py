"""Scenes of one's own as worlds.

`docs/scenes.md` says what is taken and how. Whatever has no counterpart is refused by name.

    bank_config.py   the files that a command names to the configuration of a bank
    scene_worlds.py  that configuration to worlds
    bodies.py        what readers find: bodies with their materials, and lights
    mesh_files.py    readers of PLY, OBJ and STL, which refuse what is too large before it is read
    glb_files.py     reader of GLB
    xml_scenes.py    reader of Mitsuba's scenes
    shapes.py        Mitsuba's spheres, cylinders, ... as triangles
    ways.py          poses over time, or way points and speeds, to motions
    way_checks.py    refuses ways through walls, inside closed bodies, and too fast ones
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
