"""What a world is made of: triangles with materials, things that move, lights, an ego path.

Axes: x ahead, y left, z up; metres, seconds, radians. Radiometry is inside the sensor's optical
band: irradiance W m-2, radiance W m-2 sr-1, radiant intensity W sr-1. No renderer is known here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from shotenv.config import Family
from shotenv.world.geometry.motion import Motion


@dataclass(frozen=True)
class Mesh:
    """A triangle soup with one material per face. F faces, corners not shared.

    Attributes
    ----------
    corners : float32 [F, 3, 3]
        Corner positions, metres.
    uv : float32 [F, 3, 2]
        Texture coordinates; the noise texture repeats every 1.0.
    albedo_low, albedo_high : float32 [F]
        Diffuse albedo in band where the noise texture is 0 and where it is 1.
    retro : float32 [F]
        Retro-reflection of the co-located laser, times the Lambertian return; 0 for most.
    emission : float32 [F]
        Radiance that the camera sees on the face itself, W m-2 sr-1 (lamps; their light on
        other things comes from `Lamp`).
    mirror : float32 [F]
        Share of the light that is mirrored: wet ground, glass, glossy paint; 0 for most.
    clear : float32 [F]
        Share of the light that passes straight through, as through a thin pane; 0 for most.
        The rest, 1 - mirror - clear, meets the diffuse surface below.
    kinds : frozenset of str
        Names of the kinds of things that the faces belong to.
    """

    corners: np.ndarray
    uv: np.ndarray
    albedo_low: np.ndarray
    albedo_high: np.ndarray
    retro: np.ndarray
    emission: np.ndarray
    mirror: np.ndarray
    clear: np.ndarray
    kinds: frozenset[str] = frozenset()


@dataclass(frozen=True)
class MovingObject:
    """A mesh in its own coordinates (standing on z = 0, facing +x) and its path."""

    mesh: Mesh
    motion: Motion


SWITCHING_S = 0.8
"""Time in which a lamp becomes bright; discharge lamps take longer, incandescent ones less."""


@dataclass(frozen=True)
class Lamp:
    """A small lamp that lights other things (a street lamp, a head light, a ceiling tube).

    Irradiance at distance d in direction w: intensity * falloff(angle) / (d^2 + radius_m^2); the
    radius keeps it finite close by. `cutoff_cos` = -1 shines everywhere; otherwise the intensity
    falls smoothly to 0 at that cosine from `direction`. `rides` lamps move with the camera. A lamp
    with a `carrier` is fixed to that one of `World.moving`, in whose own coordinates its position
    and direction are. It comes on at `on_s`, within `SWITCHING_S`.
    """

    position_m: tuple[float, float, float]
    intensity_w_sr: float
    radius_m: float = 0.1
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    cutoff_cos: float = -1.0
    rides: bool = False
    carrier: int | None = None
    on_s: float = -math.inf

    def share_on(self, time_s: float) -> float:
        """How much of its light a lamp gives at a time, 0 to 1."""
        return min(1.0, max(0.0, (time_s - self.on_s) / SWITCHING_S))


@dataclass(frozen=True)
class Indoor:
    """A roofed box that daylight enters through openings at its ends, one at each at most.

    Renderers aim at the opening: daylight that has to find it by chance is noise.

    Attributes
    ----------
    low, high : (x, y, z)
        Corners of the box, metres.
    opening : ((y, z), (y, z)) or None
        Lower and upper corner of the opening in the plane x = high[0].
    entrance : ((y, z), (y, z)) or None
        The same in the plane x = low[0].
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    opening: tuple[tuple[float, float], tuple[float, float]] | None
    entrance: tuple[tuple[float, float], tuple[float, float]] | None = None


@dataclass(frozen=True)
class Light:
    """All passive light in band.

    Attributes
    ----------
    sun_irradiance : float
        On a surface facing the sun, W m-2; 0 where there is no direct sun.
    sun_direction : (x, y, z)
        Unit vector towards the sun.
    sky_zenith, sky_horizon : float
        Sky radiance overhead and at the horizon, W m-2 sr-1, linear in the sine of elevation.
    lamps : tuple of Lamp
        Any number; at an instant `MAX_LAMPS` of them shine.
    indoor : Indoor or None
        The roofed part of the world, if any.
    fading_per_s : float
        Rate at which sun and sky fall from time 0 on, as at dusk: by a factor e in 1 / rate.
    """

    sun_irradiance: float
    sun_direction: tuple[float, float, float]
    sky_zenith: float
    sky_horizon: float
    lamps: tuple[Lamp, ...]
    indoor: Indoor | None = None
    fading_per_s: float = 0.0

    def at(self, time_s: float) -> Light:
        """The light of an instant: sun and sky as bright as they are then."""
        left = math.exp(-self.fading_per_s * time_s)
        return replace(
            self,
            sun_irradiance=self.sun_irradiance * left,
            sky_zenith=self.sky_zenith * left,
            sky_horizon=self.sky_horizon * left,
        )


MAX_LAMPS = 16
"""Most lamps at an instant, those nearest to the camera: renderers keep a table of this length, so
that one kernel fits all."""


@dataclass(frozen=True)
class World:
    """Everything a clip of frames is rendered from.

    Drawn from `seed` and `family` alone, or read from a file: the family is then "own".
    """

    family: Family | Literal["own"]
    seed: int
    static: Mesh
    moving: tuple[MovingObject, ...]
    light: Light
    ego: Motion
    """Path of the camera, its height in z, looking along +x of its own heading."""

    @property
    def kinds(self) -> frozenset[str]:
        """Names of the kinds of things in this world, still or moving."""
        return self.static.kinds.union(*(thing.mesh.kinds for thing in self.moving))
