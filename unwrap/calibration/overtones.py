"""Overtones of light and demodulation as four samples show them: the wiggle, and its table.

Four samples take D0 - D2 and D1 - D3. The harmonic h of a correlation, `w_h cos(h phi)`, comes out
of them as `w_h exp(+-i h phi)`, with + for h = 1, 5, 9 and - for 3, 7, 11: seen from the
fundamental these turn by multiples of 4 phi. The factor on the fundamental's phasor is their sum;
its angle is the phase error, the wiggle, and its length that of the amplitude.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from unwrap.signal import WiggleTable, harmonic_weights

Array = np.ndarray
TURNS = (4, 8, 12, 16)
"""Cycles of the wiggle in one period that a table keeps; the next are below 2e-3 rad."""
LEAST_COVERED = 12
"""Of 16 parts of a quarter period: how many must hold measurements for the curve to be told."""
TABLE_BINS = 256
STEPS = 16
"""Of the search for a strength: errors shrink by far more than half in each."""
GRID = 3073
"""Phases between which a factor is linear, to 5e-6."""


def overtone_factor(phase_rad: Array, strength: float, highest: int) -> Array:
    """What overtones make of the fundamental's phasor, complex, by the true phase."""
    factor = np.ones(np.shape(phase_rad), complex)
    for harmonic, weight in harmonic_weights(strength, highest)[1:]:
        turns = harmonic - 1 if harmonic % 4 == 1 else -harmonic - 1
        factor += weight * np.exp(1j * turns * phase_rad)
    return factor


def fundamentals(phasors: Array, strength: float, highest: int) -> Array:
    """Phasors without the overtones' part, complex, of the shape of `phasors`."""
    if strength == 0.0:
        return phasors
    return phasors / np.interp(np.angle(phasors), *_factor_by_decoded(strength, highest))


@lru_cache(maxsize=4)
def _factor_by_decoded(strength: float, highest: int) -> tuple[Array, Array]:
    """Decoded phases over more than a period, ascending, and the factor there."""
    true_rad = np.linspace(-1.5 * np.pi, 1.5 * np.pi, GRID)
    factor = overtone_factor(true_rad, strength, highest)
    return true_rad + np.angle(factor), factor


def wiggle_columns(decoded_rad: Array) -> Array:
    """1, cos and sin of `TURNS` times the decoded phase: [N, 1 + 2 len(TURNS)]."""
    angles = [turns * decoded_rad for turns in TURNS]
    waves = [wave(angle) for angle in angles for wave in (np.cos, np.sin)]
    return np.stack([np.ones_like(decoded_rad), *waves], -1)


def fit_wiggle(decoded_rad: Array, true_rad: Array, weight: Array) -> Array:
    """Phase error as a constant, which is a delay, and a Fourier series of the decoded phase.

    Four samples see overtones as multiples of 4 phi and nothing else, so that a quarter of a period
    tells the curve. Weighted least squares; all three [N].

    Returns
    -------
    [1 + 2 len(TURNS)]
        Coefficients of `wiggle_columns`, rad; NaN where the quarter period is not covered.
    """
    part = (np.mod(decoded_rad, np.pi / 2) * (16 / (np.pi / 2))).astype(int) % 16
    columns = wiggle_columns(decoded_rad)
    if np.unique(part).size < LEAST_COVERED:
        return np.full(columns.shape[1], np.nan)
    difference = decoded_rad - true_rad
    # Around the mean error, wherever it lies: a delay may be near half a period.
    middle = np.angle(np.sum(weight * np.exp(1j * difference)))
    error = np.angle(np.exp(1j * (difference - middle)))
    matrix = (columns * weight[:, None]).T @ columns
    found = np.linalg.solve(matrix, columns.T @ (weight * error))
    found[0] += middle
    return found


def strength_of(wave: float, highest: int) -> float:
    """`harmonic_strength` whose wiggle has this coefficient of sin(4 decoded), rad; by bisection.

    NaN where no strength from 0 to 1 has it.
    """
    grid = np.arange(256) * (2 * np.pi / 256)

    def wave_of(strength: float) -> float:
        error = np.angle(overtone_factor(grid, strength, highest))
        return float(fit_wiggle(grid + error, grid, np.ones_like(grid))[2])

    least, most = wave_of(0.0), wave_of(1.0)
    # The wave falls as the strength grows: the third harmonic turns against the phase.
    if not most <= wave <= least:
        return float("nan")
    low, high = 0.0, 1.0
    # Regula falsi: nearly a straight line.
    for _ in range(STEPS):
        middle = low + (high - low) * (least - wave) / (least - most)
        found = wave_of(middle)
        if abs(found - wave) < 1e-10:
            break
        if found > wave:
            low, least = middle, found
        else:
            high, most = middle, found
    return middle


def table_of(coefficients: Array) -> WiggleTable:
    """Stored table of a fitted curve, the delay included."""
    grid = np.arange(TABLE_BINS) * (2 * np.pi / TABLE_BINS)
    error = wiggle_columns(grid) @ coefficients
    return WiggleTable(tuple(np.angle(np.exp(1j * error)).tolist()))
