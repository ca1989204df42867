"""Unambiguous ranges of one and of several modulation frequencies, and how near candidates come.

Plain Python without torch, since the sensor's configuration is checked with it.
"""

from __future__ import annotations

import itertools
import math

from unwrap.support import require_positive

SPEED_OF_LIGHT_M_S = 299_792_458.0
GRID_HZ = 1000
"""Grid on which frequencies have a greatest common divisor; oscillators are no more exact."""


def unambiguous_range_m(frequency_hz: float) -> float:
    """Distance after which the phase repeats: d_u = c / (2 f).

    Examples
    --------
    >>> round(unambiguous_range_m(24e6), 4)
    6.2457
    """
    require_positive(frequency_hz=frequency_hz)
    return SPEED_OF_LIGHT_M_S / (2 * frequency_hz)


def joint_range_m(*frequencies_hz: float) -> float:
    """Distance after which all phases repeat: c / (2 gcd(f1, f2, ...)), the frequencies in kHz.

    Examples
    --------
    >>> round(joint_range_m(24e6, 10e6), 2)
    74.95
    >>> round(joint_range_m(80e6, 16e6, 120e6), 2)
    18.74
    """
    common = math.gcd(*(max(1, round(f / GRID_HZ)) for f in frequencies_hz))
    return unambiguous_range_m(common * GRID_HZ)


def candidate_spacing_m(f1_hz: float, f2_hz: float, max_range_m: float) -> float:
    """How near two wrap candidates of f1 within a range come to each other at f2, metres.

    Candidate n of f1 lies n d_u1 further, which is n d_u1 mod d_u2 at f2. The right candidate is
    found while noise makes the two frequencies disagree by less than half of this spacing.

    Examples
    --------
    >>> round(candidate_spacing_m(24e6, 10e6, 25.0), 2)
    2.5
    >>> round(candidate_spacing_m(24e6, 10e6, 74.0), 2)
    1.25
    """
    range1_m, range2_m = unambiguous_range_m(f1_hz), unambiguous_range_m(f2_hz)
    wraps = range(math.floor(max_range_m / range1_m) + 1)
    places = sorted(n * range1_m / range2_m % 1.0 for n in wraps)
    # The first place comes again a whole turn later.
    gaps = (b - a for a, b in itertools.pairwise([*places, places[0] + 1.0]))
    return range2_m * min(gaps)
