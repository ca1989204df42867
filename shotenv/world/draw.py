"""From a family and a seed to a world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shotenv.config import FAMILIES, Family, Range, WorldConfig
from shotenv.world import enclosed, lights, roads
from shotenv.world.model import Light, Motion, Pose, World
from shotenv.world.site import Site

LONGEST_DRIVE_M = 90.0
"""A world is about this long: a clip of many frames is driven more slowly."""
WIDEST_SWERVE_M = 0.4
CAMERA_HEIGHT_M = (0.6, 1.2)
STANDING_SHARE = 0.2


@dataclass(frozen=True)
class Place:
    """A kind of place: its layout, how fast and how straight it is driven, how often drawn."""

    lay_out: Callable[[Site, np.random.Generator], None]
    speed_m_s: Range
    share: float
    yaw_std_rad: float


def _garage(site: Site, rng: np.random.Generator) -> None:
    enclosed.garage(site, rng, irradiance=(5e-3, 0.1))


def _tunnel(site: Site, rng: np.random.Generator) -> None:
    enclosed.tunnel(site, rng, irradiance=(5e-3, 0.1))


def _daylight(rng: np.random.Generator) -> Light:
    return lights.sunny(rng) if rng.random() < 0.6 else lights.overcast(rng)


def _open_places(country: float, town: float, park: float) -> tuple[Place, ...]:
    return (
        Place(roads.country_road, (2.0, 15.0), country, 0.02),
        Place(roads.town_street, (0.5, 10.0), town, 0.02),
        Place(roads.car_park, (0.0, 1.2), park, 0.15),
    )


PLACES: dict[Family, tuple[Place, ...]] = {
    "sunny_road": _open_places(0.50, 0.25, 0.25),
    "overcast_street": _open_places(0.10, 0.60, 0.30),
    "garage": (Place(_garage, (0.0, 3.0), 1.0, 0.1),),
    "tunnel": (Place(_tunnel, (2.0, 15.0), 1.0, 0.02),),
    "night_road": _open_places(0.40, 0.35, 0.25),
}
LIGHTS: dict[Family, Callable[[np.random.Generator], Light]] = {
    "sunny_road": lights.sunny,
    "overcast_street": lights.overcast,
    "garage": lights.overcast,
    "tunnel": _daylight,
    "night_road": lights.night,
}


def draw_world(family: Family, seed: int, config: WorldConfig) -> World:
    """World of one clip: geometry, materials, light, what moves and the ego's path.

    The same arguments give the same world, bit for bit, in any process.

    Parameters
    ----------
    family : Family
        Kind of scene.
    seed : int
        Any non-negative integer.
    config : WorldConfig
        Ego speed and length of the clip.

    Raises
    ------
    ValueError
        An unknown family, a negative seed, or a slowest speed that leaves the world.
    """
    if family not in FAMILIES:
        raise ValueError(f"family is {family!r}; expected one of {', '.join(FAMILIES)}")
    if seed < 0:
        raise ValueError(f"seed is {seed}; expected a non-negative integer")
    rng = np.random.default_rng([FAMILIES.index(family), seed])
    places = PLACES[family]
    place = places[rng.choice(len(places), p=[place.share for place in places])]
    light = LIGHTS[family](rng)
    duration_s = config.frames_per_clip / config.frame_rate_hz
    speed = ego_speed(rng, place.speed_m_s, duration_s, config)
    ego = draw_ego(rng, speed, duration_s, place.yaw_std_rad)
    site = Site(ego, duration_s, night=family == "night_road")
    place.lay_out(site, rng)
    return site.world(family, seed, light)


def ego_speed(
    rng: np.random.Generator, usual: Range, duration_s: float, config: WorldConfig
) -> float:
    """Speed within the configured range, and within the place's usual one where they meet.

    Raises
    ------
    ValueError
        The configured slowest speed drives out of the world within the clip.
    """
    low, high = config.speed_m_s
    if low * duration_s > LONGEST_DRIVE_M:
        raise ValueError(
            f"speed_m_s is ({low:g}, {high:g}); expected at most {LONGEST_DRIVE_M / duration_s:g} "
            f"at its low end: a clip of {duration_s:g} s is driven in {LONGEST_DRIVE_M:g} m"
        )
    wish = 0.0 if rng.random() < STANDING_SHARE else rng.uniform(*usual)
    return float(np.clip(wish, low, min(high, LONGEST_DRIVE_M / duration_s)))


def draw_ego(
    rng: np.random.Generator, speed_m_s: float, duration_s: float, yaw_std_rad: float
) -> Motion:
    """Path of the camera: a height, a slight pitch, and a bend too slight to leave the lane."""
    height, pitch = float(rng.uniform(*CAMERA_HEIGHT_M)), float(rng.uniform(-0.03, 0.03))
    yaw, rate = rng.normal(0.0, (yaw_std_rad, 0.04))
    # On a shallow arc the path shifts sideways by travel * (yaw + rate * duration / 2).
    most = WIDEST_SWERVE_M / 2 / max(speed_m_s * duration_s, 1.0)
    start = Pose((0.0, 0.0, height), _within(most, yaw), pitch)
    return Motion(start, speed_m_s, _within(2 * most / duration_s, rate) * (speed_m_s > 0))


def _within(most: float, wish: float) -> float:
    return float(np.clip(wish, -most, most))
