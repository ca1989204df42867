"""The one surface texture: tileable noise of several octaves, the same in every world."""

from __future__ import annotations

import functools

import numpy as np

RESOLUTION = 256
_OCTAVE_GAIN = 0.6
"""Strength of an octave over that of the coarser one before; assumed."""
_SEED = 20231
"""Fixed: another texture would change every rendered bank."""
_COARSEST_CELLS = 4
_OCTAVES = 6
"""The finest cells are two texels wide: more octaves would be finer than the texture."""


@functools.cache
def noise_texture() -> np.ndarray:
    """Noise [256, 256] float32 in [0, 1] that repeats without a seam; row = v, column = u."""
    rng = np.random.default_rng(_SEED)
    total = np.zeros((RESOLUTION, RESOLUTION))
    for octave in range(_OCTAVES):
        cells = _COARSEST_CELLS * 2**octave
        total += _value_noise(rng.uniform(-1.0, 1.0, (cells, cells))) * _OCTAVE_GAIN**octave
    # Clipped at both ends, so that albedos reach the whole range that their finish gives.
    low, high = np.quantile(total, [0.01, 0.99])
    return np.clip((total - low) / (high - low), 0.0, 1.0).astype(np.float32)


def _value_noise(grid: np.ndarray) -> np.ndarray:
    """Periodic value noise: `grid` interpolated with a cubic fade to the texture's resolution."""
    cells = len(grid)
    position = (np.arange(RESOLUTION) + 0.5) * cells / RESOLUTION
    low = position.astype(int)
    t = position - low
    fade = t * t * (3 - 2 * t)
    high = (low + 1) % cells
    rows = grid[low] * (1 - fade)[:, None] + grid[high] * fade[:, None]
    return rows[:, low] * (1 - fade) + rows[:, high] * fade
