"""What rain and snow do to the surfaces that lie open to the sky.

Wet: water fills the pores, so that less light comes back, and its film mirrors. Snow: level
surfaces turn white, first where the noise texture is bright, so that a thin cover is patchy.
How much of each is assumed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shotenv.world.geometry.meshes import area_vectors
from shotenv.world.geometry.model import Mesh
from unwrap.support import Range

WET_DARKENING = 0.5
"""Share of the albedo that soaked ground loses."""
WET_RETRO_LOSS = 0.8
"""Share of the retro-reflection that it loses: water levels the beads of road paint."""
FILM_MIRROR = 0.12
"""Mirrored share of a closed film of water: Fresnel's at 70 degrees from the normal."""
SNOW_ALBEDO = 0.9
LEVEL_COS, SETTLING_COS = 0.9, 0.5
"""Cosine of the steepest slope on which water stands, and on which snow stays."""


@dataclass(frozen=True)
class Weather:
    """State of what lies open to the sky.

    Attributes
    ----------
    wetness : float
        0 is dry, 1 is soaked.
    snow : float
        0 is none, 1 is a closed cover.
    """

    wetness: float = 0.0
    snow: float = 0.0


DRY = Weather()


def draw_weather(
    rng: np.random.Generator, wet_share: float, snow_share: float, cover: Range
) -> Weather:
    """Wet or snowed over with these probabilities, the snow within `cover`; otherwise dry."""
    # All three are drawn in any weather, so that the draws that follow do not depend on it.
    kind, wetness, snow = rng.random(), rng.uniform(0.4, 1.0), rng.uniform(*cover)
    if kind < wet_share:
        return Weather(wetness=wetness)
    return Weather(snow=snow) if kind < wet_share + snow_share else DRY


def weathered(mesh: Mesh, weather: Weather) -> Mesh:
    """`mesh` as it looks in this weather."""
    return snowed(wetted(mesh, weather.wetness), weather.snow)


def wetted(mesh: Mesh, wetness: float) -> Mesh:
    """`mesh` with its level faces wet; 0 leaves it as it is."""
    # Water runs off whatever is steeper.
    amount = wetness * (_upward(mesh) > LEVEL_COS)
    rest = np.float32(1.0 - WET_DARKENING * amount)
    return replace(
        mesh,
        albedo_low=mesh.albedo_low * rest,
        albedo_high=mesh.albedo_high * rest,
        retro=mesh.retro * np.float32(1.0 - WET_RETRO_LOSS * amount),
        mirror=np.maximum(mesh.mirror, np.float32(FILM_MIRROR * amount)),
    )


def snowed(mesh: Mesh, snow: float) -> Mesh:
    """`mesh` with snow on what faces up; 0 leaves it as it is."""
    settles = _upward(mesh) > SETTLING_COS
    # Bright spots of the texture turn white until half the cover, dark ones from there on.
    on_bright = np.float32(settles * min(1.0, 2.0 * snow))
    on_dark = np.float32(settles * max(0.0, 2.0 * snow - 1.0))
    bare = np.float32(1.0 - settles * snow)
    return replace(
        mesh,
        albedo_low=mesh.albedo_low + on_dark * (np.float32(SNOW_ALBEDO) - mesh.albedo_low),
        albedo_high=mesh.albedo_high + on_bright * (np.float32(SNOW_ALBEDO) - mesh.albedo_high),
        retro=mesh.retro * bare,
        mirror=mesh.mirror * bare,
        clear=mesh.clear * bare,
    )


def _upward(mesh: Mesh) -> np.ndarray:
    """Vertical component [F] of the faces' unit normals."""
    normal = area_vectors(mesh.corners.astype(np.float64))
    return normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)
