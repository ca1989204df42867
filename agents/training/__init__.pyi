from .checkpoint import CHECKPOINT as CHECKPOINT
from .sb3_vector import Sb3VecEnv as Sb3VecEnv
from .scheduler import VALIDATION as VALIDATION, train_scheduler as train_scheduler
