from . import lights as lights, materials as materials, meshes as meshes
from .materials import Material as Material
from .model import (
    MAX_LAMPS as MAX_LAMPS,
    Indoor as Indoor,
    Lamp as Lamp,
    Light as Light,
    Mesh as Mesh,
    Motion as Motion,
    Pose as Pose,
    World as World,
)
from .site import Site as Site
from .weather import draw_weather as draw_weather
