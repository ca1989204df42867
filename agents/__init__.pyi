from .evaluation import Tuned as Tuned, tune as tune, tuning_envs as tuning_envs
from .policies import (
    FAMILIES_OF_PRACTICE as FAMILIES_OF_PRACTICE,
    CyclePolicy as CyclePolicy,
    DistanceHysteresisPolicy as DistanceHysteresisPolicy,
    FixedPolicy as FixedPolicy,
    LinUcbPolicy as LinUcbPolicy,
    LookAndHoldPolicy as LookAndHoldPolicy,
    LookAndWeighPolicy as LookAndWeighPolicy,
    MixturePolicy as MixturePolicy,
    MotionPolicy as MotionPolicy,
    NetworkPolicy as NetworkPolicy,
    PersistencePolicy as PersistencePolicy,
    Policy as Policy,
    PolicyFamily as PolicyFamily,
    RandomPolicy as RandomPolicy,
    SnrThresholdPolicy as SnrThresholdPolicy,
    SnrTwoThresholdPolicy as SnrTwoThresholdPolicy,
    ThompsonPolicy as ThompsonPolicy,
    UnsurePolicy as UnsurePolicy,
    WakeOnChangePolicy as WakeOnChangePolicy,
    load_policy as load_policy,
)
from .training import Sb3VecEnv as Sb3VecEnv
