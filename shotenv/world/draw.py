"""From a family and a seed to a world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shotenv.config import Family, WorldConfig
from shotenv.world.ego import draw_ego
from shotenv.world.families import SETTINGS
from shotenv.world.geometry import Site, World, draw_weather, lights
from unwrap.support import require_choice


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
    require_choice(SETTINGS, family=family)
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
    ego, road = draw_ego(rng, place, duration_s, config)
    # The site is laid out last: it keeps the ego's way free and reaches as far as it drives.
    site = Site(ego, duration_s, lights.is_dark(light), weather, road)
    place.lay_out(site, rng)
    falls = rng.random() < setting.dusk_share
    world = site.world(family, seed, lights.dusk(rng, light, duration_s) if falls else light)
    if falls:
        world = replace(world, light=lights.switched_on(rng, world.light, duration_s))
    return world
