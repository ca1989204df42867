from . import lights as lights, materials as materials, meshes as meshes
from .materials import Material as Material
from .model import (
    MAX_LAMPS as MAX_LAMPS,
    Indoor as Indoor,
    Lamp as Lamp,
    Light as Light,
    Mesh as Mesh,
    World as World,
)
from .motion import (
    Arc as Arc,
    Motion as Motion,
    Pose as Pose,
    ground_speed_m_s as ground_speed_m_s,
    rotation as rotation,
    yaw_rate_rad_s as yaw_rate_rad_s,
)
from .mounting import mounted as mounted
from .site import Site as Site
from .weather import draw_weather as draw_weather
