"""How the laser's light is modulated, and how a sample correlates with it."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.render.backend import upload
from shotenv.render.instants import Instants
from unwrap.signal import SPEED_OF_LIGHT_M_S

Harmonics = tuple[tuple[int, float], ...]
"""Odd harmonics 1, 3, 5, ... and their weights."""
FUNDAMENTAL: Harmonics = ((1, 1.0),)


class Modulation:
    """Frequency and demodulation phase of each lane's sample, and the shape of the correlation."""

    def __init__(self, instants: Instants, harmonics: Harmonics, instant: Any):
        wave_number = np.array(instants.frequency_hz) * (2 * np.pi / SPEED_OF_LIGHT_M_S)
        self._wave_number = dr.gather(mi.Float, upload(wave_number), instant)
        self._theta = dr.gather(mi.Float, upload(np.array(instants.theta_rad)), instant)
        self._harmonics = harmonics

    def at(self, path_m):
        """Correlation, relative to unmodulated light, after a way of `path_m` metres."""
        cosine = dr.cos(dr.fma(path_m, self._wave_number, -self._theta))
        return odd_series(cosine, self._harmonics)


def odd_series(cosine, harmonics: Harmonics):
    """Sum over the harmonics of w_h cos(h x), from cos x, by Clenshaw's recurrence.

    Of the odd Chebyshev polynomials, T_(h+2) = (4 cos(x)^2 - 2) T_h - T_(h-2) and T_(-1) = T_1.
    """
    twice = 4 * cosine * cosine - 2
    # From the highest harmonic down; one cosine per path, however many harmonics there are.
    here, above = 0.0, 0.0
    for _, weight in reversed(harmonics):
        here, above = weight + twice * here - above, here
    return cosine * (here - above)
