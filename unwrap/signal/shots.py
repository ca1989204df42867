"""Which samples an acquisition takes: how many, at which frequency, in which order, when.

Sample k of 0..7 is D_k ~ m S cos(phi - k pi / 2), with the signal S and the demodulation contrast
m: 0..3 are taken at f1, 4..7 at f2, so that acquisitions of 2 and 4 DCS are prefixes of that of 8.
`unwrap.signal.decoding` inverts this model, and `correlation_samples` of `unwrap.signal.wiggle`
draws samples by it.
"""

from __future__ import annotations

import enum
import math

SAMPLES_PER_FREQUENCY = 4


class Shots(enum.IntEnum):
    """Number of differential correlation samples (DCS) of one frame."""

    TWO = 2
    FOUR = 4
    EIGHT = 8

    @property
    def action(self) -> int:
        """Environment action that asks for these shots: 0 = 2 DCS, 1 = 4 DCS, 2 = 8 DCS."""
        return tuple(type(self)).index(self)


def demodulation_phase_rad(sample: int) -> float:
    """Phase theta_k of the demodulation signal of sample `sample` (0..7), in radians."""
    return (sample % SAMPLES_PER_FREQUENCY) * (math.pi / 2)


def frequency_index(sample: int) -> int:
    """0 where sample `sample` (0..7) is taken at f1, 1 where it is taken at f2."""
    return sample // SAMPLES_PER_FREQUENCY


def sample_times_s(shots: int, sample_period_s: float) -> tuple[float, ...]:
    """Start of each sample after the start of the frame, in seconds: t_k = k * period.

    `sample_period_s` is integration time plus readout time.

    Examples
    --------
    >>> sample_times_s(Shots.FOUR, 0.25)
    (0.0, 0.25, 0.5, 0.75)
    """
    return tuple(k * sample_period_s for k in range(int(shots)))


def harmonic_weights(strength: float, highest: int) -> tuple[tuple[int, float], ...]:
    """Odd harmonics of the correlation and their weights relative to the fundamental.

    Square light times square demodulation correlates to a triangle, sum of cos(h phi) / h^2 over
    odd h; `strength` scales what lies beyond the fundamental.

    Parameters
    ----------
    strength : float
        0 = pure sine, 1 = ideal squares.
    highest : int
        Highest harmonic kept, odd.

    Raises
    ------
    ValueError
        A strength outside 0..1, or a highest harmonic that is even or less than 1.

    Examples
    --------
    >>> harmonic_weights(0.0, 7)
    ((1, 1.0),)
    >>> harmonic_weights(1.0, 3)
    ((1, 1.0), (3, 0.1111111111111111))
    """
    if not 0.0 <= strength <= 1.0:
        raise ValueError(f"strength is {strength}; expected 0 to 1")
    if highest < 1 or highest % 2 == 0:
        raise ValueError(f"highest is {highest}; expected an odd number of at least 1")
    # Without strength none are listed, so that a pure sine costs one cosine.
    overtones = range(3, highest + 1, 2) if strength > 0 else ()
    return ((1, 1.0), *((h, strength / h**2) for h in overtones))
