"""Linear contextual bandits that learn on the drive, from what the sensor itself measures.

No true error is used: labels are the measured regrets, which only frames of 8 DCS tell. Such a
frame tells those of all shots at once, and one of 2 DCS tells nothing, whatever it brings. What is
unknown is therefore not tried but looked at: doubt counts against 2 and 4 DCS, and 8 DCS teach.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from agents.policies.looking import ENERGY_SHARES, REGRETS
from agents.policies.policy import Action, Observation, Policy, single
from agents.policies.readings import (
    MOST,
    Readings,
    checked_at_least,
    checked_energy_shares,
    checked_seed,
)

CONTEXT: Final = (
    "gray_mean",
    "gray_std",
    "ambient_level",
    "network_distance",
    "network_confidence",
    "amplitude",
    "signal_to_noise",
    "valid_share",
    "two_from_four",
    *REGRETS,
)
"""Features that regrets are linear in, beside a constant."""


class LinearBanditPolicy(Policy):
    """Ridge regression of the regrets of 2 and 4 DCS on the context, one for each drive.

    The least of estimated regret + price x energy share is taken; 8 DCS have no regret. Before
    the first frame nothing is known, and 8 DCS are taken.

    Parameters
    ----------
    width : float
        How much doubt counts, error terms at a standard deviation of 1; 0 is greedy.
    ridge : float
        Weight of the prior, which holds that all coefficients are 0.
    forget : float
        Weight of the past after each frame of 8 DCS, 1e-9..1; 1 forgets nothing.
    energy_shares : sequence of 3 floats
        Energy of 2, 4 and 8 DCS relative to 8.
    """

    reads_price = True

    def __init__(
        self,
        feature_names: Sequence[str],
        width: float,
        ridge: float = 1.0,
        forget: float = 1.0,
        *,
        energy_shares: Sequence[float] = ENERGY_SHARES,
    ) -> None:
        self.width = checked_at_least("width", width, 0.0, MOST)
        self.ridge = checked_at_least("ridge", ridge, 1e-9, MOST)
        self.forget = checked_at_least("forget", forget, 1e-9, 1.0)
        self._shares = checked_energy_shares(energy_shares)
        self._read = Readings(feature_names, "last_eight", "power_price", *CONTEXT)
        self._context: np.ndarray | None = None

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """What costs least by what was learnt so far; learns first from the last frame."""
        shape = np.shape(self._read("last_eight", observation))
        size = len(CONTEXT) + 1
        before = self._context
        if before is None:
            prior = self.ridge * np.eye(size)
            self._precision = np.broadcast_to(prior, (*shape, size, size)).copy()
            self._moment = np.zeros((*shape, size, len(REGRETS)))
        else:
            self._learn(before, observation)
        features = [self._read(name, observation) for name in CONTEXT]
        context = np.stack([np.ones(shape), *features], axis=-1)
        self._context = context
        covariance = np.linalg.inv(self._precision)
        doubt = np.sqrt(np.einsum("...i,...ij,...j->...", context, covariance, context))
        mean = np.einsum("...i,...ij->...j", context, covariance @ self._moment)
        regret = self._judged(mean, doubt)
        cost = self._read.power_price(observation)[..., None] * self._shares
        cost[..., : len(REGRETS)] += np.inf if before is None else regret
        return single(cost.argmin(axis=-1))

    def reset(self) -> None:
        """Forget all drives."""
        self._context = None

    @property
    def _parameters(self) -> str:
        return f"width {self.width:g}, ridge {self.ridge:g}, forget {self.forget:g}"

    @abstractmethod
    def _judged(self, mean: np.ndarray, doubt: np.ndarray) -> np.ndarray:
        """Regrets [..., 2] to act on, of their means [..., 2] and the common doubt [...]."""

    def _learn(self, context: np.ndarray, observation: Observation) -> None:
        """Add the frame of `context`, where it was one of 8 DCS and so told both regrets."""
        told = self._read("last_eight", observation)[..., None, None] > 0.5
        regrets = self._read.regrets(observation)[..., : len(REGRETS)]
        prior = self.ridge * np.eye(len(CONTEXT) + 1)
        square = context[..., :, None] * context[..., None, :]
        product = context[..., :, None] * regrets[..., None, :]
        # The prior is not forgotten, or the precision would vanish along what is never seen.
        kept = prior + self.forget * (self._precision - prior)
        self._precision = np.where(told, kept + square, self._precision)
        self._moment = np.where(told, self.forget * self._moment + product, self._moment)


class LinUcbPolicy(LinearBanditPolicy):
    """Confidence bounds: regrets are as large as they might be, mean + `width` x deviation.

    After Li, Chu, Langford and Schapire, "A contextual-bandit approach to personalized news article
    recommendation", WWW 2010, with the bound on the side of the arm that teaches: there the arm in
    doubt is the one that tells, here it is 8 DCS that tell of all.
    """

    def _judged(self, mean: np.ndarray, doubt: np.ndarray) -> np.ndarray:
        return mean + self.width * doubt[..., None]

    def __str__(self) -> str:
        """The rule in words."""
        return f"LinUCB on measured regrets, {self._parameters}"


class ThompsonPolicy(LinearBanditPolicy):
    """Posterior sampling: regrets of coefficients that are drawn from what they might be.

    After Agrawal and Goyal, "Thompson sampling for contextual bandits with linear payoffs", ICML
    2013; `width` is the standard deviation of a label. The draws are those of `seed`.
    """

    def __init__(
        self,
        feature_names: Sequence[str],
        width: float,
        ridge: float = 1.0,
        forget: float = 1.0,
        *,
        seed: int = 0,
        energy_shares: Sequence[float] = ENERGY_SHARES,
    ) -> None:
        super().__init__(feature_names, width, ridge, forget, energy_shares=energy_shares)
        self._seed = checked_seed(seed)
        self._generator = np.random.default_rng(self._seed)

    def _judged(self, mean: np.ndarray, doubt: np.ndarray) -> np.ndarray:
        # The context's regret is normal with this deviation, which is all that a draw of the
        # coefficients brings to it.
        return mean + self.width * doubt[..., None] * self._generator.standard_normal(mean.shape)

    def reset(self) -> None:
        """Forget all drives, and draw the same numbers again."""
        super().reset()
        self._generator = np.random.default_rng(self._seed)

    def __str__(self) -> str:
        """The rule in words."""
        return f"Thompson sampling of measured regrets, {self._parameters}"
