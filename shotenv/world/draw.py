"""From a family and a seed to a world."""

from __future__ import annotations

import numpy as np

from shotenv.config import Family, WorldConfig
from shotenv.world.families import SETTINGS
from shotenv.world.geometry import Arc, Pose, Site, World, draw_weather, lights
from unwrap.support import Range

LONGEST_DRIVE_M = 90.0
"""A world is about this long: a clip of many frames is driven more slowly."""
WIDEST_SWERVE_M = 0.4
"""How far the ego's path may lead off its lane's middle: the lane stays free that wide."""
CAMERA_HEIGHT_M = (0.6, 1.2)
"""From a car's bumper to its wind screen."""
CAMERA_PITCH_RAD = (-0.03, 0.03)
"""1.7 degrees up or down; assumed."""
YAW_RATE_STD_RAD_S = 0.04
"""Of the bends that a lane has, before they are limited to what stays in it; assumed."""
STANDING_SHARE = 0.2
"""Share of the clips in which the ego stands still, as at lights or when parked; assumed."""


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
    # One stream for everything, read in this order: a draw more or less here or in a layout gives
    # other worlds to every seed, and other digests to every bank.
    setting = SETTINGS[family]
    place = setting.places[rng.choice(len(setting.places), p=[p.share for p in setting.places])]
    light = setting.light(rng)
    weather = draw_weather(rng, setting.wet_share, setting.snow_share, setting.snow_cover)
    duration_s = config.frames_per_clip / config.frame_rate_hz
    speed_m_s = draw_ego_speed(rng, place.speed_m_s, duration_s, config)
    ego = draw_ego(rng, speed_m_s, duration_s, place.yaw_std_rad)
    # The site is laid out last: it keeps the ego's way free and reaches as far as it drives.
    site = Site(ego, duration_s, lights.is_dark(light), weather)
    place.lay_out(site, rng)
    return site.world(family, seed, light)


def draw_ego_speed(
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
    # The range that was asked for has the last word: a place of slow cars is then driven faster.
    wish = 0.0 if rng.random() < STANDING_SHARE else rng.uniform(*usual)
    return float(np.clip(wish, low, min(high, LONGEST_DRIVE_M / duration_s)))


def draw_ego(
    rng: np.random.Generator, speed_m_s: float, duration_s: float, yaw_std_rad: float
) -> Arc:
    """Path of the camera: a height, a slight pitch, and a bend too slight to leave the lane."""
    height, pitch = float(rng.uniform(*CAMERA_HEIGHT_M)), float(rng.uniform(*CAMERA_PITCH_RAD))
    yaw, rate = rng.normal(0.0, (yaw_std_rad, YAW_RATE_STD_RAD_S))
    # On a shallow arc the path shifts sideways by travel * (yaw + rate * duration / 2): half of
    # the swerve is left to each. Below 1 m of travel the limit no longer grows.
    most_yaw = WIDEST_SWERVE_M / 2 / max(speed_m_s * duration_s, 1.0)
    most_rate = 2 * most_yaw / duration_s
    start = Pose((0.0, 0.0, height), float(np.clip(yaw, -most_yaw, most_yaw)), pitch)
    # Who stands still does not turn either.
    turning = float(np.clip(rate, -most_rate, most_rate)) * (speed_m_s > 0)
    return Arc(start, speed_m_s, turning)
