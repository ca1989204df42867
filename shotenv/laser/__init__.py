"""The laser: energy, heat, trip, ageing and eye safety of what is chosen.

What is made of arithmetic alone takes torch tensors and NumPy arrays alike. Every effect is a
parameter of `LaserConfig` that is off at zero, and then costs no operation.
"""

from shotenv.laser.ageing import ageing_rate
from shotenv.laser.energy import efficiency_at, emitted_power_w, shot_cost
from shotenv.laser.state import LaserState, laser_step, start_laser, too_bright
from shotenv.laser.thermal import case_step, junction_step, relaxed, trip_step

__all__ = ["LaserState", "ageing_rate", "case_step", "efficiency_at", "emitted_power_w"]
__all__ += ["junction_step", "laser_step", "relaxed", "shot_cost"]
__all__ += ["start_laser", "too_bright", "trip_step"]
