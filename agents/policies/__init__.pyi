from .fixed import (
    CyclePolicy as CyclePolicy,
    FixedPolicy as FixedPolicy,
    RandomPolicy as RandomPolicy,
)
from .learned import (
    NetworkPolicy as NetworkPolicy,
    Provenance as Provenance,
    first_line as first_line,
    load_policy as load_policy,
)
from .policy import Action as Action, Observation as Observation, Policy as Policy
from .rules import (
    SNR_FEATURE as SNR_FEATURE,
    SnrThresholdPolicy as SnrThresholdPolicy,
    rule_in_words as rule_in_words,
)
from .score_networks import linear_layers as linear_layers, widths_of as widths_of
