from .paired import PairedVecEnv as PairedVecEnv
from .ppo import Trainer as Trainer, training_drives as training_drives
from .sb3_vector import Sb3VecEnv as Sb3VecEnv
from .warmup import (
    ROLLOUTS as ROLLOUTS,
    KnownFrames as KnownFrames,
    known_frames as known_frames,
    warm_start as warm_start,
)
