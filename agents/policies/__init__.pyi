from .fixed import (
    CyclePolicy as CyclePolicy,
    FixedPolicy as FixedPolicy,
    RandomPolicy as RandomPolicy,
)
from .learned import (
    PpoPolicy as PpoPolicy,
    first_line as first_line,
    load_policy as load_policy,
    network_arguments as network_arguments,
)
from .policy import Action as Action, Observation as Observation, Policy as Policy
from .rules import (
    SNR_FEATURE as SNR_FEATURE,
    SnrThresholdPolicy as SnrThresholdPolicy,
    rule_in_words as rule_in_words,
)
