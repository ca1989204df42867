"""A Gymnasium environment of an indirect time-of-flight sensor that pays for every sample.

Importing this package registers `shotenv/ShotSchedule-v0`; it loads neither torch nor mitsuba.
"""

import gymnasium
import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

ENV_ID = "shotenv/ShotSchedule-v0"

if ENV_ID not in gymnasium.registry:
    gymnasium.register(
        id=ENV_ID,
        entry_point="shotenv.env:ShotScheduleEnv",
        vector_entry_point="shotenv.env:ShotScheduleVectorEnv",
    )
