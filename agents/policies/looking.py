"""Policies that measure what fewer shots lose: 2 and 4 DCS are the first samples of 8.

A frame of 8 DCS tells the sensor itself, without any truth, how far off 2 and 4 DCS would have
been: their measured regrets, mean error terms over valid pixels, good for the frames that follow.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from agents.policies.policy import Action, Observation, Policy, single
from agents.policies.readings import (
    MOST,
    Readings,
    checked_at_least,
    checked_energy_shares,
    checked_frames,
    fewest_shots,
)
from unwrap.signal import Shots

ENERGY_SHARES: Final = (0.34, 0.56, 1.0)
"""Energy of a frame of 2, 4 and 8 DCS relative to 8 in the default configuration: medians over 24
validation drives, among which laser power and integration time spread them over .29 to .42 and .53
to .62."""
REGRETS: Final = ("regret_of_two", "regret_of_four")


class PersistencePolicy(Policy):
    """The fewest shots whose regret in the last frame of 8 DCS was below a limit, held for a while.

    Persistence is what forecasts are compared with, next is as last: Murphy, "Climatology,
    persistence, and their linear combination as standards of reference in skill scores", Weather
    and Forecasting 7 (1992). It does not see the scene change; a frame of 8 DCS comes at the start
    and every `period` frames.

    Parameters
    ----------
    limit : float
        Regret that is tolerable, an error term of 0..0.5.
    period : int
        Frames from one frame of 8 DCS to the next.
    """

    def __init__(self, feature_names: Sequence[str], limit: float, period: int) -> None:
        self.limit = checked_at_least("limit", limit, 0.0)
        self.period = checked_frames("period", period, 2)
        self._read = Readings(feature_names, "since_eight", *REGRETS)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """8 DCS every `period` frames, and between what they found to be enough."""
        # Rounded, for the feature is a logarithm of frames in float32.
        look = np.rint(self._read.frames_since_eight(observation)) >= self.period - 1
        held = fewest_shots(self._read.regrets(observation) < self.limit)
        return single(np.where(look, Shots.EIGHT.action, held))

    def __str__(self) -> str:
        """The rule in words."""
        return (
            f"8 DCS every {self.period} frames, between them the fewest whose regret was below "
            f"{self.limit:g}"
        )


class LookAndHoldPolicy(Policy):
    """Looks with 8 DCS after a change or every n frames, then holds the fewest shots that do.

    A change is one of the gray image since the last look, or, because the dark shows none, one of
    the measured amplitude. Sampling where the signal has moved by a limit, and else after a longest
    pause, is known as send-on-delta: Miskowicz, "Send-on-delta concept: an event-based data
    reporting strategy", Sensors 6 (2006).

    Parameters
    ----------
    limit : float
        Regret that is tolerable, an error term of 0..0.5.
    period : int
        Most frames from one look to the next.
    change : float
        Mean change of log10 ambient radiance since the last look that calls for another.
    amplitude_change : float
        Change of log10 of the mean amplitude that does; infinite: never.
    reference_frame : {0, 1}
        Amplitude that the change is measured from: 0 is that of the look, 1 that of the frame after
        it. Noise makes the amplitude of 2 DCS larger than that of 8: from the look, dark frames
        seem to change once 2 DCS are held, and are looked at again.
    """

    def __init__(
        self,
        feature_names: Sequence[str],
        limit: float,
        period: int,
        change: float,
        amplitude_change: float = np.inf,
        reference_frame: int = 0,
    ) -> None:
        self.limit = checked_at_least("limit", limit, 0.0)
        self.looks = Looks(feature_names, period, change, amplitude_change, reference_frame)
        self._read = Readings(feature_names, *REGRETS)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """8 DCS where it is time to look, elsewhere the fewest shots that were good enough."""
        held = fewest_shots(self._read.regrets(observation) < self.limit)
        return single(np.where(self.looks.due(observation), Shots.EIGHT.action, held))

    def reset(self) -> None:
        """Forget the last look."""
        self.looks.reset()

    def __str__(self) -> str:
        """The rule in words."""
        return f"{self.looks}, then the fewest whose regret was below {self.limit:g}"


class LookAndWeighPolicy(Policy):
    """Looks like `LookAndHoldPolicy`, then holds the shots whose regret and energy weigh least.

    The least of `gain` * regret + (p + h / (1 + m / `near_k`)) * energy share, with the price p of
    power that the observation tells, and m kelvin left to the trip. With a `heat_price` h it is
    greedy with a price on heat, which rises as heat piles up like that of a queue in Neely,
    "Stochastic Network Optimization" (2010), ch. 4 (drift plus penalty); the costs are those of the
    last look, not foreseen ones.

    Parameters
    ----------
    period, change, amplitude_change, reference_frame
        As for `LookAndHoldPolicy`.
    gain : float
        True loss for each unit of measured regret: what 8 DCS measure is noisy itself, and they see
        valid pixels alone.
    heat_price : float
        Price of energy right at the trip, error terms.
    near_k : float
        Margin at which heat costs half of that, kelvin.
    energy_shares : sequence of 3 floats
        Energy of 2, 4 and 8 DCS relative to 8.
    """

    reads_price = True

    def __init__(
        self,
        feature_names: Sequence[str],
        period: int,
        change: float,
        amplitude_change: float = np.inf,
        reference_frame: int = 0,
        *,
        gain: float = 1.0,
        heat_price: float = 0.0,
        near_k: float = 2.0,
        energy_shares: Sequence[float] = ENERGY_SHARES,
    ) -> None:
        self.gain = checked_at_least("gain", gain, 0.0, MOST)
        self.heat_price = checked_at_least("heat_price", heat_price, 0.0, MOST)
        self.near_k = checked_at_least("near_k", near_k, 1e-6, MOST)
        self.looks = Looks(feature_names, period, change, amplitude_change, reference_frame)
        self._shares = checked_energy_shares(energy_shares)
        self._read = Readings(feature_names, "power_price", "heat_margin", *REGRETS)

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """8 DCS where it is time to look, elsewhere what costs least by the last look."""
        margin_k = np.maximum(self._read.heat_margin(observation), 0.0)
        heat = self.heat_price / (1.0 + margin_k / self.near_k)
        price = (self._read.power_price(observation) + heat)[..., None]
        cost = self.gain * self._read.regrets(observation) + price * self._shares
        held = cost.argmin(axis=-1)
        return single(np.where(self.looks.due(observation), Shots.EIGHT.action, held))

    def reset(self) -> None:
        """Forget the last look."""
        self.looks.reset()

    def __str__(self) -> str:
        """The rule in words."""
        heat = f", heat {self.heat_price:g}, near {self.near_k:g} K" if self.heat_price else ""
        return f"{self.looks}, then the least of {self.gain:g} x regret + price x energy{heat}"


class Looks:
    """When 8 DCS are due: at the start, after a change, and some frames after the last.

    Parameters
    ----------
    period, change, amplitude_change, reference_frame
        As for `LookAndHoldPolicy`.
    """

    def __init__(
        self,
        feature_names: Sequence[str],
        period: int,
        change: float,
        amplitude_change: float = np.inf,
        reference_frame: int = 0,
    ) -> None:
        self.period = checked_frames("period", period, 2)
        self.change = checked_at_least("change", change, 0.0)
        self.amplitude_change = checked_at_least("amplitude_change", amplitude_change, 0.0)
        if not isinstance(reference_frame, int | np.integer) or reference_frame not in (0, 1):
            raise ValueError(f"reference_frame is {reference_frame!r}; expected 0 or 1")
        self.reference_frame = reference_frame
        needed = ("since_eight", "change_since_eight", "amplitude")
        self._read = Readings(feature_names, *needed)
        self._reference = np.array(0.0)

    def due(self, observation: Observation) -> np.ndarray:
        """Where to look in this frame, bool [] or [N]."""
        frames = np.rint(self._read.frames_since_eight(observation))
        # The feature is log10 over 3.
        amplitude = 3.0 * self._read("amplitude", observation)
        at_reference = frames <= self.reference_frame
        self._reference = np.where(at_reference, amplitude, self._reference)
        changed = self._read("change_since_eight", observation) > self.change
        moved = np.abs(amplitude - self._reference) > self.amplitude_change
        return changed | moved | (frames >= self.period - 1)

    def reset(self) -> None:
        """Forget the last look."""
        self._reference = np.array(0.0)

    def __str__(self) -> str:
        """When to look, in words."""
        words = f"8 DCS every {self.period} frames"
        if np.isfinite(self.change):
            words += f", after a change of {self.change:g}"
        if np.isfinite(self.amplitude_change):
            since = ("the look", "the frame after it")[self.reference_frame]
            words += f", and after one of {self.amplitude_change:g} in amplitude since {since}"
        return words
