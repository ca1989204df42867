"""A Gymnasium environment of an indirect time-of-flight sensor that pays for every sample.

Importing this package registers `shotenv/ShotSchedule-v0`; it loads neither torch nor mitsuba.
"""

import gymnasium

ENV_ID = "shotenv/ShotSchedule-v0"

__all__ = ["ENV_ID"]

if ENV_ID not in gymnasium.registry:
    gymnasium.register(
        id=ENV_ID,
        entry_point="shotenv.env:ShotScheduleEnv",
        vector_entry_point="shotenv.vector_env:ShotScheduleVectorEnv",
    )
