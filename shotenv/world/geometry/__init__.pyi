from . import lights as lights, materials as materials, meshes as meshes
from .gait import (
    LEAN as LEAN,
    Leg as Leg,
    Posture as Posture,
    Segment as Segment,
    pedalling_posture as pedalling_posture,
    walking_posture as walking_posture,
)
from .materials import Material as Material
from .model import (
    MAX_LAMPS as MAX_LAMPS,
    Indoor as Indoor,
    Lamp as Lamp,
    Light as Light,
    Mesh as Mesh,
    MovingObject as MovingObject,
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
from .mounting import mounted as mounted
from .mover import (
    Along as Along,
    Mover as Mover,
    Part as Part,
    Rigid as Rigid,
    Wheels as Wheels,
)
from .road import Curve as Curve
from .site import Site as Site
from .speed import (
    SpeedChange as SpeedChange,
    SpeedProfile as SpeedProfile,
    change_s as change_s,
    speeds_in_turn as speeds_in_turn,
)
from .vehicle import Body as Body, Drive as Drive
from .weather import draw_weather as draw_weather
