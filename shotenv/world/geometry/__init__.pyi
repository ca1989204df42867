from . import lights as lights, materials as materials, meshes as meshes
from .gait import Leg as Leg
from .limbs import Limb as Limb, Pedalling as Pedalling, Walking as Walking
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
    Route as Route,
    ground_speed_m_s as ground_speed_m_s,
    rotation as rotation,
    yaw_rate_rad_s as yaw_rate_rad_s,
)
from .mover import (
    Along as Along,
    Mover as Mover,
    Part as Part,
    Rigid as Rigid,
    Wheels as Wheels,
)
from .site import Site as Site
from .weather import draw_weather as draw_weather
