"""TODO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from shotenv.decision import feature_index

if TYPE_CHECKING:
    pass
from agents.policies.policy import Action, Observation, Policy, checked_shots, single

SNR_FEATURE: Final = "signal_to_noise"


class SnrThresholdPolicy(Policy):
    """One threshold on the signal-to-noise ratio of the last acquisition.

    Parameters
    ----------
    feature_names : sequence of str
        `env.unwrapped.feature_names`, to find the ratio in the observation.
    threshold : float
        Compared with the feature as observed, that is after the environment's scaling.
    below, above : int
        Shots where the ratio is below, and at or above, the threshold.
    """

    def __init__(
        self, feature_names: Sequence[str], threshold: float, below: int, above: int
    ) -> None:
        self._index = feature_index(feature_names, SNR_FEATURE)
        self.threshold = threshold
        self.below, self.above = checked_shots(below), checked_shots(above)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Shots by the side of the threshold on which the last signal-to-noise was."""
        low = np.asarray(observation)[..., self._index] < self.threshold
        return single(np.where(low, self.below.action, self.above.action))

    def __str__(self) -> str:
        """The rule in words."""
        return f"{self.below:d} DCS where {SNR_FEATURE} < {self.threshold:.3f}, else {self.above:d}"
