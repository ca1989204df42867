from .sb3_vector import Sb3VecEnv as Sb3VecEnv
from .scheduler import train_scheduler as train_scheduler
