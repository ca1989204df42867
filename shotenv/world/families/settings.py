"""What each family is drawn from: its places, its light, its weather. One row per family."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shotenv.config import Family
from shotenv.world.families import (
    clutter,
    construction,
    forest,
    garage,
    roads,
    snow,
    tunnel,
    warehouse,
)
from shotenv.world.geometry import Light, Site, lights
from unwrap.support import Range

DrawLight = Callable[[np.random.Generator], Light]


@dataclass(frozen=True)
class Place:
    """A kind of place.

    Attributes
    ----------
    lay_out : callable
        Builds and furnishes a site.
    speed_m_s : (low, high)
        Usual speed of the ego there, drawn uniformly.
    share : float
        How often a family's world is of this kind; the shares of a family add up to 1.
    bend_m : (low, high) or None
        Radii of the road's bends, drawn log-uniformly; None where it is straight.
    corner_m : (low, high) or None
        Radii on which the ego turns into another street or aisle; None where it does not.
    corner_share : float
        How often it does.
    parks : bool
        The ego drives into a parking place or out of it, instead of along a lane.
    roughness : float
        How much it shakes, in terms of asphalt.
    """

    lay_out: Callable[[Site, np.random.Generator], None]
    speed_m_s: Range
    share: float
    bend_m: Range | None = None
    corner_m: Range | None = None
    corner_share: float = 0.0
    parks: bool = False
    roughness: float = 1.0


@dataclass(frozen=True)
class Setting:
    """What the worlds of a family are drawn from.

    Attributes
    ----------
    places : tuple of Place
    light : callable
        Draws sun and sky; lamps of streets and ceilings come with the place.
    wet_share, snow_share : float
        Shares of the worlds after rain, and after snow.
    snow_cover : (low, high)
        Cover of the snowy ones: 0 is none, 1 is closed.
    dusk_share : float
        Share of the worlds, all of them at night, in which night only falls.
    """

    places: tuple[Place, ...]
    light: DrawLight
    wet_share: float = 0.0
    snow_share: float = 0.0
    snow_cover: Range = (0.3, 0.7)
    dusk_share: float = 0.0


def sun_night_or_clouds(sun_share: float, low_share: float, night_share: float = 0.0) -> DrawLight:
    """Sun (low with probability `low_share` of those), night, or else an overcast sky."""

    def draw(rng: np.random.Generator) -> Light:
        kind = rng.random()
        if kind < sun_share:
            return lights.sunny(rng, low_share)
        return lights.night(rng) if kind < sun_share + night_share else lights.overcast(rng)

    return draw


def open_places(country: float, town: float, park: float) -> tuple[Place, ...]:
    """Country roads, town streets and car parks with these shares."""
    return (
        Place(roads.lay_out_country_road, (2.0, 15.0), country, bend_m=(60.0, 400.0)),
        Place(roads.lay_out_town_street, (0.5, 10.0), town, (80.0, 400.0), (13.0, 18.0), 0.3),
        Place(roads.lay_out_car_park, (0.0, 2.0), park, parks=True),
    )


# In garages and halls the light is the overcast sky seen through an opening, if there is one; under
# a roof weather stays outside.
SETTINGS: dict[Family, Setting] = {
    "sunny_road": Setting(open_places(0.50, 0.25, 0.25), lights.sunny, wet_share=0.15),
    "overcast_street": Setting(
        open_places(0.10, 0.60, 0.30), lights.overcast, wet_share=0.40, snow_share=0.12
    ),
    "garage": Setting(
        (Place(garage.lay_out_garage, (0.0, 4.0), 1.0, None, (6.0, 7.5), 0.35),), lights.overcast
    ),
    "tunnel": Setting(
        (Place(tunnel.lay_out_tunnel, (2.0, 15.0), 1.0),), sun_night_or_clouds(0.6, 0.3)
    ),
    "night_road": Setting(
        open_places(0.40, 0.35, 0.25),
        lights.night,
        wet_share=0.40,
        snow_share=0.08,
        dusk_share=0.15,
    ),
    # From here on held out from training: `shotenv.config.families.SHIFT_FAMILIES`.
    "warehouse": Setting(
        (Place(warehouse.lay_out_warehouse, (0.0, 3.0), 1.0, None, (4.5, 6.0), 0.35),),
        lights.overcast,
    ),
    "construction_site": Setting(
        (
            Place(
                construction.lay_out_construction_site,
                (0.0, 6.0),
                1.0,
                (35.0, 150.0),
                roughness=2.5,
            ),
        ),
        sun_night_or_clouds(0.5, 0.3, night_share=0.25),
        wet_share=0.3,
    ),
    "forest_path": Setting(
        (Place(forest.lay_out_forest_path, (0.0, 4.0), 1.0, (25.0, 80.0), roughness=3.0),),
        sun_night_or_clouds(0.6, 0.5),
        wet_share=0.2,
    ),
    "snowy_street": Setting(
        (Place(snow.lay_out_snowy_street, (0.0, 8.0), 1.0, (40.0, 200.0), roughness=1.5),),
        sun_night_or_clouds(0.5, 0.7, night_share=0.2),
        snow_share=1.0,
        snow_cover=(0.7, 1.0),
    ),
    # For networks to learn from, and in no other split: `TRAINING_FAMILIES` there.
    "clutter": Setting(
        (
            Place(clutter.lay_out_room, (0.0, 1.5), 0.35),
            Place(clutter.lay_out_hall, (0.0, 6.0), 0.35),
            Place(clutter.lay_out_open_ground, (0.0, 12.0), 0.30),
        ),
        sun_night_or_clouds(0.35, 0.4, night_share=0.25),
    ),
}
