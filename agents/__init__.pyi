from .policies import (
    CyclePolicy as CyclePolicy,
    FixedPolicy as FixedPolicy,
    NetworkPolicy as NetworkPolicy,
    Policy as Policy,
    RandomPolicy as RandomPolicy,
    SnrThresholdPolicy as SnrThresholdPolicy,
    load_policy as load_policy,
)
from .training import Sb3VecEnv as Sb3VecEnv
