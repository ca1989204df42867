from .cost import ENERGY_PARTS as ENERGY_PARTS, ShotCost as ShotCost
from .energy import (
    NO_NETWORK as NO_NETWORK,
    NetworkWork as NetworkWork,
    efficiency_at as efficiency_at,
    emitted_power_w as emitted_power_w,
    heat_of as heat_of,
    shot_cost as shot_cost,
)
from .laser_state import (
    LaserState as LaserState,
    laser_step as laser_step,
    start_laser as start_laser,
    too_bright as too_bright,
    warmed_k as warmed_k,
)
from .thermal import case_step as case_step, junction_step as junction_step, trip_step as trip_step
