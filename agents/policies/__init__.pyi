from .bandits import LinUcbPolicy as LinUcbPolicy, ThompsonPolicy as ThompsonPolicy
from .fixed import (
    CyclePolicy as CyclePolicy,
    FixedPolicy as FixedPolicy,
    MixturePolicy as MixturePolicy,
    RandomPolicy as RandomPolicy,
)
from .learned import (
    NetworkPolicy as NetworkPolicy,
    Scheduler as Scheduler,
    load_policy as load_policy,
)
from .looking import (
    LookAndHoldPolicy as LookAndHoldPolicy,
    LookAndWeighPolicy as LookAndWeighPolicy,
    PersistencePolicy as PersistencePolicy,
)
from .policy import Action as Action, Observation as Observation, Policy as Policy
from .practice import (
    FAMILIES_OF_PRACTICE as FAMILIES_OF_PRACTICE,
    PolicyFamily as PolicyFamily,
)
from .recurrent import RecurrentPolicy as RecurrentPolicy
from .rules import (
    SNR_FEATURE as SNR_FEATURE,
    SnrThresholdPolicy as SnrThresholdPolicy,
    SnrTwoThresholdPolicy as SnrTwoThresholdPolicy,
    rule_in_words as rule_in_words,
)
from .scheduler_files import Provenance as Provenance, first_line as first_line
from .score_networks import (
    linear_layers as linear_layers,
    mean_network as mean_network,
    rescaled_network as rescaled_network,
    score_network as score_network,
    weights_in_blocks as weights_in_blocks,
    widths_of as widths_of,
)
from .watching import (
    DistanceHysteresisPolicy as DistanceHysteresisPolicy,
    MotionPolicy as MotionPolicy,
    UnsurePolicy as UnsurePolicy,
    WakeOnChangePolicy as WakeOnChangePolicy,
)
