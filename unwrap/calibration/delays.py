"""Distances of known walls, and the drift of distance with the imager's temperature."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from unwrap.calibration.intervals import Estimate, around
from unwrap.calibration.moments import Moments
from unwrap.calibration.overtones import fit_wiggle
from unwrap.signal import SPEED_OF_LIGHT_M_S

Array = np.ndarray
LEAST_TEMPERATURES = 3
"""Two leave nothing to tell an interval by."""


def rad_per_m(frequencies_hz: Sequence[float]) -> Array:
    """Phase per metre of distance, 4 pi f / c, [K]."""
    return 4 * np.pi * np.asarray(frequencies_hz) / SPEED_OF_LIGHT_M_S


def wall_phases(
    walls: Sequence[Moments], stretch: Array, frequencies_hz: Sequence[float]
) -> tuple[Array, Array, Array]:
    """Decoded phases, those of the known distances, and the weights of N pixels of walls.

    Pixels count by their squared amplitude, the inverse of their phases' variance, and not at all
    where a frame was saturated. All three are [K, N].

    Parameters
    ----------
    stretch : [P]
        Radial distance of a pixel over that along the optical axis.
    """
    phasors = np.concatenate([wall.phasors for wall in walls], -1)
    true_m = np.concatenate([wall.setting.distance_m * stretch for wall in walls])
    frames = np.concatenate([wall.frames * (wall.flagged == 0) for wall in walls])
    true_rad = rad_per_m(frequencies_hz)[:, None] * true_m
    return np.angle(phasors), true_rad, frames * np.abs(phasors) ** 2


def wall_curves(walls: Sequence[Moments], stretch: Array, frequencies_hz: Sequence[float]) -> Array:
    """Coefficients of the phase error at each frequency [K, 9]; see `fit_wiggle`, `wall_phases`."""
    return np.stack([*map(fit_wiggle, *wall_phases(walls, stretch, frequencies_hz))])


def common_delay_m(delays_rad: Array, frequencies_hz: Sequence[float]) -> float:
    """One distance offset of the delays at all frequencies [K], metres.

    The mean with weights f^2, the inverse of the distances' variance at equal phase noise.
    """
    per_m = rad_per_m(frequencies_hz)
    return float(np.average(delays_rad / per_m, weights=per_m**2))


def drift_points(
    light: Sequence[Array], frequencies_hz: Sequence[float], flagged: Sequence[Array]
) -> Array:
    """Distance of each recording beyond that of the first, metres.

    Parameters
    ----------
    light : complex [K, P] of each recording
        Phasors without overtones.
    flagged : [P] of each
    """
    usable = np.all([share == 0 for share in flagged], axis=0)
    shifts = [np.angle((phasors * light[0].conj())[:, usable].sum(-1)) for phasors in light]
    return np.array([common_delay_m(shift, frequencies_hz) for shift in shifts])


def drift_per_kelvin(temperature_k: Array, distance_m: Array) -> Estimate | None:
    """Slope of distances over temperature by least squares, m/K, with Student's interval.

    Recordings scatter by more than their frames tell (thermometer, time to settle): the interval is
    by their residuals. None of fewer than `LEAST_TEMPERATURES`.
    """
    if np.unique(temperature_k).size < LEAST_TEMPERATURES:
        return None
    warmer = temperature_k - temperature_k.mean()
    spread = np.square(warmer).sum()
    slope = warmer @ distance_m / spread
    residual = distance_m - distance_m.mean() - slope * warmer
    freedom = len(warmer) - 2
    return around(slope, float(np.sqrt(residual @ residual / freedom / spread)), freedom)
