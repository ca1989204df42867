"""Rules that a person can read off: thresholds on one feature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from agents.policies.policy import Action, Observation, Policy, checked_shots, single
from agents.policies.readings import checked_at_least
from shotenv.decision import feature_index

SNR_FEATURE: Final = "signal_to_noise"


class SnrThresholdPolicy(Policy):
    """One threshold on the signal-to-noise ratio of the last acquisition.

    As adaptive modulation picks its rate by the channel's signal-to-noise: Goldsmith and Chua,
    "Variable-rate variable-power MQAM for fading channels", IEEE Trans. Commun. 45 (1997).

    Parameters
    ----------
    feature_names : sequence of str
        `env.unwrapped.feature_names`, to find the ratio in the observation.
    threshold : float
        Compared with the feature as observed: q / (q + 1) of each pixel, q its amplitude over four
        standard deviations of a sample, averaged; a pixel at four has 0.5.
    below, above : int
        Shots where the ratio is below, and at or above, the threshold.
    """

    def __init__(
        self, feature_names: Sequence[str], threshold: float, below: int, above: int
    ) -> None:
        self._index = feature_index(feature_names, SNR_FEATURE)
        self.threshold = checked_at_least("threshold", threshold, 0.0)
        self.below, self.above = checked_shots(below, "below"), checked_shots(above, "above")

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Shots by the side of the threshold on which the last signal-to-noise was."""
        low = np.asarray(observation)[..., self._index] < self.threshold
        return single(np.where(low, self.below.action, self.above.action))

    def __str__(self) -> str:
        """The rule in words."""
        return rule_in_words(self.threshold, self.below, self.above)


class SnrTwoThresholdPolicy(Policy):
    """Two thresholds on the signal-to-noise ratio of the last acquisition: three kinds of frames.

    Parameters
    ----------
    low, high : float
        Thresholds, as that of `SnrThresholdPolicy`; `low` <= `high`.
    below, between, above : int
        Shots below `low`, from it on, and from `high` on.
    """

    def __init__(
        self,
        feature_names: Sequence[str],
        low: float,
        high: float,
        below: int = 8,
        between: int = 4,
        above: int = 2,
    ) -> None:
        self._index = feature_index(feature_names, SNR_FEATURE)
        self.low = checked_at_least("low", low, 0.0)
        self.high = checked_at_least("high", high, self.low)
        named = {"below": below, "between": between, "above": above}
        self.shots = tuple(checked_shots(shots, name) for name, shots in named.items())

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """Shots by the band in which the last signal-to-noise was."""
        ratio = np.asarray(observation)[..., self._index]
        below, between, above = (shots.action for shots in self.shots)
        return single(
            np.where(ratio < self.low, below, np.where(ratio < self.high, between, above))
        )

    def __str__(self) -> str:
        """The rule in words."""
        below, between, above = self.shots
        return (
            f"{below:d} DCS where {SNR_FEATURE} < {self.low:.3f}, {between:d} where it is < "
            f"{self.high:.3f}, else {above:d}"
        )


def rule_in_words(threshold: float, below: int, above: int) -> str:
    """A one-threshold rule that takes `below` or `above` shots.

    Examples
    --------
    >>> rule_in_words(0.25, below=8, above=2)
    '8 DCS where signal_to_noise < 0.250, else 2'
    """
    return f"{below:d} DCS where {SNR_FEATURE} < {threshold:.3f}, else {above:d}"
