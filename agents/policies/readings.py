"""What an observation reads in units: the one place where policies undo its scaling.

The scales are those of the table of features (`shotenv.decision.FEATURES`).
"""

from __future__ import annotations

import numbers
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

import numpy as np

from agents.policies.policy import Observation
from shotenv.decision import feature_index, heat_margin_k
from unwrap.signal import Shots


class Readings:
    """Reads features by name from the observation of one environment, or of a batch of them.

    Parameters
    ----------
    feature_names : sequence of str
        `env.unwrapped.feature_names`.
    needed : str
        Features that will be read.

    Raises
    ------
    ValueError
        `feature_names` lacks one of them.

    Examples
    --------
    >>> readings = Readings(("last_eight", "since_eight"), "since_eight")
    >>> round(float(readings.frames_since_eight(np.array([0.0, 0.3935]))), 2)
    8.0
    """

    def __init__(self, feature_names: Sequence[str], *needed: str) -> None:
        self._index = {name: feature_index(feature_names, name) for name in needed}

    def __call__(self, name: str, observation: Observation) -> np.ndarray:
        """The feature as it is observed, float64 [] or [N]."""
        whole = observation["state"] if isinstance(observation, Mapping) else observation
        return np.asarray(whole, dtype=np.float64)[..., self._index[name]]

    def regret(self, name: str, observation: Observation) -> np.ndarray:
        """`regret_of_two`, `regret_of_four` or `two_from_four` as an error term, 0..0.5."""
        return self(name, observation) / 4.0

    def regrets(self, observation: Observation) -> np.ndarray:
        """Measured regret of each action, error terms [..., 3]; that of 8 DCS is 0."""
        two = self.regret("regret_of_two", observation)
        four = self.regret("regret_of_four", observation)
        return np.stack([two, four, np.zeros_like(two)], axis=-1)

    def frames_since_eight(self, observation: Observation) -> np.ndarray:
        """Frames since the last of 8 DCS: 0 right after it, infinite before the first."""
        with np.errstate(divide="ignore"):
            return -16.0 * np.log1p(-self("since_eight", observation))

    def power_price(self, observation: Observation) -> np.ndarray:
        """Weight of power in the reward, error terms."""
        share = self("power_price", observation)
        return 0.05 * share / (1.0 - share)

    def heat_margin(self, observation: Observation) -> np.ndarray:
        """Kelvin to the laser's trip, negative while it is off."""
        return heat_margin_k(self("heat_margin", observation))

    def speed_m_s(self, observation: Observation) -> np.ndarray:
        """Speed of the camera without its direction, m/s."""
        return 15.0 * np.abs(self("ego_speed", observation))

    def yaw_rate_rad_s(self, observation: Observation) -> np.ndarray:
        """Yaw rate without its direction, rad/s."""
        return 0.5 * np.abs(self("yaw_rate", observation))


def fewest_shots(tolerable: np.ndarray) -> np.ndarray:
    """Action with the fewest shots that is tolerable, of bool [..., 3]; 8 DCS always are.

    Examples
    --------
    >>> fewest_shots(np.array([[False, True, True], [False, False, False]]))
    array([1, 2])
    """
    return np.where(tolerable[..., 0], 0, np.where(tolerable[..., 1], 1, Shots.EIGHT.action))


MOST: Final = 1e9
"""Largest parameter that costs are computed with: their products stay numbers."""


def checked_at_least(name: str, value: float, least: float, most: float = np.inf) -> float:
    """`value`, a parameter of a policy, as Python's float.

    Raises
    ------
    ValueError
        It is below `least` or above `most`, or no number.
    """
    number = np.nan
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        with suppress(OverflowError):  # A whole number of more than 308 digits.
            number = float(value)
    if not least <= number <= most:
        bound = f" and at most {most:g}" if np.isfinite(most) else ""
        raise ValueError(f"{name} is {value!r}; expected at least {least:g}{bound}")
    return number


def checked_frames(name: str, value: float, least: int) -> int:
    """`value`, a number of frames among a policy's parameters.

    Raises
    ------
    ValueError
        It is below `least`, or no whole number.
    """
    if checked_at_least(name, value, least, MOST) % 1 != 0:
        raise ValueError(f"{name} is {value!r}; expected a whole number of frames")
    return int(value)


def checked_seed(seed: int) -> int:
    """`seed`, of a policy's draws.

    Raises
    ------
    ValueError
        It is no whole number of at least 0 and below 2^63, as those of drives are.
    """
    whole = isinstance(seed, int | np.integer) and not isinstance(seed, bool)
    if not whole or not 0 <= seed < 2**63:
        raise ValueError(f"seed is {seed!r}; expected a whole number of 0 to 2^63 - 1")
    return int(seed)


def checked_energy_shares(energy_shares: Sequence[float]) -> np.ndarray:
    """Energy of 2, 4 and 8 DCS relative to 8, float64 [3].

    Raises
    ------
    ValueError
        They are not three numbers of 0 to `MOST`.
    """
    shares = three_numbers(energy_shares)
    if not ((shares >= 0) & (shares <= MOST)).all():
        raise ValueError(f"energy_shares is {energy_shares!r}; expected three numbers >= 0")
    return shares


def three_numbers(values: Any) -> np.ndarray:
    """`values` as float64 [3], one for each of the shots; NaN where they are something else."""
    listed = np.empty(0)
    if isinstance(values, list | tuple | np.ndarray):
        with suppress(ValueError):  # Lists of several lengths.
            listed = np.asarray(values)
    if listed.shape != (len(Shots),) or listed.dtype.kind not in "iuf":
        return np.full(len(Shots), np.nan)
    return listed.astype(np.float64)
