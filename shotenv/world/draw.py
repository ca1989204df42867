"""From a family and a seed to a world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shotenv.config import Family, WorldConfig
from shotenv.world.families import construction, enclosed, forest, roads, snow, warehouse
from shotenv.world.geometry import Light, Motion, Pose, Site, World, draw_weather, lights
from unwrap.support import Range

DrawLight = Callable[[np.random.Generator], Light]

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


@dataclass(frozen=True)
class Setting:
    """What a family is drawn from: places, light, and the shares of wet and of snowy worlds."""

    places: tuple[Place, ...]
    light: DrawLight
    wet_share: float = 0.0
    snow_share: float = 0.0
    snow_cover: Range = (0.3, 0.7)


def _garage(site: Site, rng: np.random.Generator) -> None:
    enclosed.garage(site, rng, irradiance=(5e-3, 0.1))


def _tunnel(site: Site, rng: np.random.Generator) -> None:
    enclosed.tunnel(site, rng, irradiance=(5e-3, 0.1))


def _warehouse(site: Site, rng: np.random.Generator) -> None:
    warehouse.hall(site, rng, irradiance=(1e-2, 0.3))


def _either(sun_share: float, low_share: float, night_share: float = 0.0) -> DrawLight:
    """Sun (low with its own probability), night, or an overcast sky."""

    def draw(rng: np.random.Generator) -> Light:
        kind = rng.random()
        if kind < sun_share:
            return lights.sunny(rng, low_share)
        return lights.night(rng) if kind < sun_share + night_share else lights.overcast(rng)

    return draw


def _open_places(country: float, town: float, park: float) -> tuple[Place, ...]:
    return (
        Place(roads.country_road, (2.0, 15.0), country, 0.02),
        Place(roads.town_street, (0.5, 10.0), town, 0.02),
        Place(roads.car_park, (0.0, 1.2), park, 0.15),
    )


SETTINGS: dict[Family, Setting] = {
    "sunny_road": Setting(_open_places(0.50, 0.25, 0.25), lights.sunny, wet_share=0.15),
    "overcast_street": Setting(
        _open_places(0.10, 0.60, 0.30), lights.overcast, wet_share=0.40, snow_share=0.12
    ),
    "garage": Setting((Place(_garage, (0.0, 3.0), 1.0, 0.1),), lights.overcast),
    "tunnel": Setting((Place(_tunnel, (2.0, 15.0), 1.0, 0.02),), _either(0.6, 0.3)),
    "night_road": Setting(
        _open_places(0.40, 0.35, 0.25), lights.night, wet_share=0.40, snow_share=0.08
    ),
    "warehouse": Setting((Place(_warehouse, (0.0, 3.0), 1.0, 0.1),), lights.overcast),
    "construction_site": Setting(
        (Place(construction.construction_site, (0.0, 6.0), 1.0, 0.05),),
        _either(0.5, 0.3, night_share=0.25),
        wet_share=0.3,
    ),
    "forest_path": Setting(
        (Place(forest.forest_path, (0.0, 4.0), 1.0, 0.05),), _either(0.6, 0.5), wet_share=0.2
    ),
    "snowy_street": Setting(
        (Place(snow.snowy_street, (0.0, 8.0), 1.0, 0.03),),
        _either(0.5, 0.7, night_share=0.2),
        snow_share=1.0,
        snow_cover=(0.7, 1.0),
    ),
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
    if family not in SETTINGS:
        raise ValueError(f"family is {family!r}; expected one of {', '.join(SETTINGS)}")
    if seed < 0:
        raise ValueError(f"seed is {seed}; expected a non-negative integer")
    # Seeded by its name, a family keeps its worlds when others come or go.
    rng = np.random.default_rng([*family.encode(), seed])
    setting = SETTINGS[family]
    place = setting.places[rng.choice(len(setting.places), p=[p.share for p in setting.places])]
    light = setting.light(rng)
    weather = draw_weather(rng, setting.wet_share, setting.snow_share, setting.snow_cover)
    duration_s = config.frames_per_clip / config.frame_rate_hz
    speed = ego_speed(rng, place.speed_m_s, duration_s, config)
    ego = draw_ego(rng, speed, duration_s, place.yaw_std_rad)
    site = Site(ego, duration_s, lights.is_dark(light), weather)
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
