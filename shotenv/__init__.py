"""A Gymnasium environment of an indirect time-of-flight sensor that pays for every sample.

Importing this package registers `shotenv/ShotSchedule-v0` and its variants: with images, with a
reward that is a vector, and those that are compared often; it loads neither torch nor mitsuba.
"""

from typing import Any

import gymnasium
import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)

ENV_ID = "shotenv/ShotSchedule-v0"
IMAGE_ENV_ID = "shotenv/ShotScheduleImage-v0"
MO_ENV_ID = "shotenv/MOShotSchedule-v0"


def _register(env_id: str, faces: str, **arguments: Any) -> None:
    if env_id not in gymnasium.registry:
        gymnasium.register(
            id=env_id,
            entry_point=f"shotenv.env:{faces}Env",
            vector_entry_point=f"shotenv.env:{faces}VectorEnv",
            **arguments,
        )


# Without `max_episode_steps`: it could not follow `frames_per_drive`, and gymnasium would cut
# longer drives. Environments end their drives themselves and put the length into their `spec`.
_register(ENV_ID, "ShotSchedule")
# Images need a bank with every pixel, whatever the default of the others is.
_register(IMAGE_ENV_ID, "ShotSchedule", kwargs={"observation": "image", "bank": "starter"})
# Gymnasium's checker would warn of each reward that it is no single number.
_register(MO_ENV_ID, "MOShotSchedule", disable_env_checker=True)
# What is compared often: heat that binds, the strongest unwrapping, families never trained on.
_register("shotenv/ShotSchedule-Hot-v0", "ShotSchedule", kwargs={"config": "hot"})
_register("shotenv/ShotSchedule-Strong-v0", "ShotSchedule", kwargs={"config": "strong"})
_register("shotenv/ShotSchedule-Shift-v0", "ShotSchedule", kwargs={"split": "shift"})
