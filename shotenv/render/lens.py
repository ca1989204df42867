"""What a lens does to the light of an image: veiling glare and a ghost, linear and energy kept.

Every light alike: ambient radiance, the laser's, and its correlations, whose signs a sum of phasors
needs. Light that glare would carry out of the image comes back at its border, as if the scene went
on mirrored there: so an even scene stays even, and no light is lost or made.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from shotenv.config import SensorConfig

Array = np.ndarray
REACH = 6.0
"""Standard deviations at which a kernel ends: what is beyond is below the rounding of a float."""


def through_lens(images: Array, sensor: SensorConfig) -> Array:
    """Images [..., H, W] of any light as the lens of `sensor` shows them, in their own dtype.

    A share `veiling_glare` of the light is spread by a Gaussian of standard deviation
    `veiling_glare_width` times the image's width; a share `ghost` is mirrored through the image's
    centre, as by two reflections within the lens, and blurred by `ghost_width`. Kernels and ghost
    are the same at all wavelengths and everywhere in the image. Both shares 0: `images` itself.
    """
    glare, ghost = sensor.veiling_glare, sensor.ghost
    if not (glare or ghost):
        return images
    shown = (1.0 - glare - ghost) * images
    if glare:
        shown += glare * blurred(images, sensor.veiling_glare_width)
    if ghost:
        shown += ghost * blurred(images, sensor.ghost_width)[..., ::-1, ::-1]
    return shown.astype(images.dtype)


def blurred(images: Array, width: float) -> Array:
    """Images [..., H, W] blurred by a Gaussian of `width` image widths that the border mirrors."""
    height, across = images.shape[-2:]
    spread_px = width * across
    # Of float64 matrices: no value becomes negative that was not, as it could with transforms. All
    # rows in one product, which takes a third less time than image by image.
    rows = images.astype(np.float64).reshape(-1, across) @ kernel(across, spread_px)
    return kernel(height, spread_px) @ rows.reshape(images.shape)


@lru_cache(maxsize=16)
def kernel(pixels: int, spread_px: float) -> Array:
    """Gaussian blur of a line of pixels with mirrored ends, float64 [pixels, pixels].

    Symmetric, and all rows and columns sum to 1: what a pixel gives away others get.
    """
    if not spread_px:
        return np.eye(pixels)
    reach = int(np.ceil(REACH * spread_px))
    steps = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (steps / spread_px) ** 2)
    weights /= weights.sum()
    matrix = np.zeros((pixels, pixels))
    for start in range(pixels):
        # Beyond the last pixel comes the last pixel again, then those before it.
        place = (start + steps) % (2 * pixels)
        np.add.at(matrix[start], np.minimum(place, 2 * pixels - 1 - place), weights)
    return matrix
