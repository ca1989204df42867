"""Roads, streets and car parks under the open sky. The ego's lane is centred on y = 0."""

from __future__ import annotations

import numpy as np

from shotenv.world.families.traffic import (
    pavement_thing,
    put_crossers,
    put_cyclist,
    put_oncoming,
    put_row,
    put_street_lamps,
    put_vehicle_ahead,
    put_walkers,
    roadside_thing,
)
from shotenv.world.geometry import Mesh, Site, lights, materials as m, meshes
from shotenv.world.things import buildings, furniture, plants, shelters, vehicles
from unwrap.support import Range

BEHIND_M = 60.0
REACH_M = 120.0
"""How far ground and roads reach behind the ego, and beyond the end of its way and to the sides."""
SHOP_LIGHTING = lights.Lighting((50.0, 300.0), {"led": 0.6, "fluorescent": 0.2, "halogen": 0.2})
"""Luminance of the ceiling of a shop that is lit by night, cd m-2; all assumed."""
KERB_M = 0.12
"""Height of a pavement over the road."""
UNDER_ROAD_M = -0.01
"""Height of the ground beside a road, which lies under the road as well."""
PAINT_M = 0.008
PUDDLE_M = 0.013
"""Heights of paint and of water over the ground: each layer above those that it may cover."""


def lay_out_country_road(site: Site, rng: np.random.Generator) -> None:
    """Two lanes, verges, trees, signs, guard rails, traffic."""
    lane = rng.uniform(3.0, 3.75)
    # Traffic drives on the right: the other lane is to the left, that is towards +y.
    right, left = -lane / 2 - 0.4, 1.5 * lane + 0.4
    build_carriageway(site, rng, right, left, lane)
    site.build_ground((m.GRASS if rng.random() < 0.7 else m.SOIL).draw(rng), UNDER_ROAD_M)
    # What moves comes first: its way must be free for the whole clip, and parked things fill up.
    put_vehicle_ahead(site, rng)
    for part in site.stretches():
        put_oncoming(part, rng, lane)
        put_walkers(part, rng, (0, 3), (right - 1.5, right - 0.6))
        put_cyclist(part, rng, right + 0.35)
    if rng.random() < 0.4:
        rail = furniture.guard_rail if rng.random() < 0.6 else furniture.jersey_barrier
        length, x = rng.uniform(12.0, 30.0), site.travel_m / 2 + rng.uniform(6, 20)
        site.put(rail(rng, length), x, right - 0.7, np.pi / 2)
    if rng.random() < 0.3:
        length = rng.uniform(6, 16)
        x = site.travel_m + rng.uniform(5, 15)
        site.put(hedge_or_wall(rng, length), x, left + 1.5, -np.pi / 2)
    put_street_lamps(site, rng, right - 1.2, rng.uniform(18, 30))
    put_row(site, rng, roadside_thing, right - 1.3, 3.5, np.pi, share=0.75, spread=2.0)
    put_row(site, rng, roadside_thing, left + 1.3, 4.5, 0.0, share=0.7, spread=3.0)
    put_row(site, rng, plants.tree, right - 6.0, 9.0, 0.0, share=0.5, spread=3.0)


def lay_out_town_street(site: Site, rng: np.random.Generator) -> None:
    """A street between facades with pavements, parked cars and people who cross."""
    lane, far = rng.uniform(2.8, 3.4), site.travel_m + REACH_M
    parking = rng.uniform(2.0, 2.3)
    # Without parked cars on the left there is a gutter.
    parking_left = parking if rng.random() < 0.5 else 0.3
    right, left = -lane / 2 - parking, 1.5 * lane + parking_left
    pavement = rng.uniform(1.8, 3.2)
    build_carriageway(site, rng, right, left, lane, edge_lines=False)
    paving = m.PAVING.draw(rng)
    site.build_ground(m.GRASS.draw(rng) if rng.random() < 0.5 else paving, UNDER_ROAD_M)
    for side, kerb in ((-1, right), (1, left)):
        site.build(side_walk(rng, side, kerb, (-BEHIND_M, far), pavement + 1.0, paving))
    put_facades(site, rng, right - pavement, np.pi / 2)
    put_facades(site, rng, left + pavement, -np.pi / 2)
    put_vehicle_ahead(site, rng)
    for part in site.stretches():
        # Who crosses comes first: drivers stop for them.
        put_crossers(part, rng, (right + 0.3, left - 0.3))
        put_oncoming(part, rng, lane)
        put_walkers(part, rng, (1, 4), (right - pavement + 0.5, right - 0.5), KERB_M)
        put_walkers(part, rng, (0, 3), (left + 0.5, left + pavement - 0.5), KERB_M)
        put_cyclist(part, rng, -lane / 2 - 0.1)
    put_row(
        site,
        rng,
        vehicles.parked_car,
        right + parking / 2 + 0.05,
        5.8,
        0.0,
        share=rng.uniform(0.3, 0.9),
    )
    if parking_left == parking:
        put_row(
            site,
            rng,
            vehicles.parked_car,
            left - parking / 2,
            6.0,
            np.pi,
            share=rng.uniform(0.2, 0.8),
        )
    put_street_lamps(site, rng, right - 0.5, rng.uniform(13, 20), KERB_M)
    put_row(site, rng, pavement_thing, right - 0.5, 2.6, np.pi, KERB_M, share=0.6)
    put_row(site, rng, pavement_thing, left + 0.5, 3.5, 0.0, KERB_M, share=0.5)


def lay_out_car_park(site: Site, rng: np.random.Generator) -> None:
    """The ego noses up to a wall, a hedge or a car; more cars and people beside."""
    site.build_ground((m.ASPHALT if rng.random() < 0.6 else m.PAVING).draw(rng))
    # The power favours short distances: car parks are much of the near field.
    end = site.travel_m + 0.7 + 5.0 * rng.uniform() ** 1.5
    paint_bays(site, rng, end, rng.uniform(2.5, 2.9))
    build_puddles(site, rng, (-5.0, 5.0))
    # Walls, hedges and houses all around: who turns looks to every side.
    for side in (-1, 1):
        for x in np.arange(end - 28.0, end + 25.0, 13.0):
            if rng.random() < 0.7:
                site.put(backdrop(rng), x, side * rng.uniform(13.0, 20.0), -side * np.pi / 2)
    for y in (-14.0, 0.0, 14.0):
        site.put(backdrop(rng), end - rng.uniform(32.0, 38.0), y)
    ahead = rng.random()
    if ahead < 0.35:
        car, facing = vehicles.car(rng).at_rest, np.pi if rng.random() < 0.5 else 0.0
        half_length = float(car.corners[..., 0].max())
        site.put(car, end + half_length, rng.uniform(-0.4, 0.4), facing)
        site.put(backdrop(rng), end + rng.uniform(7, 14), rng.uniform(-3, 3), np.pi)
    elif ahead < 0.9:
        site.put(backdrop(rng), end, rng.uniform(-2, 2), np.pi)
    # Beside the ego, beyond what it faces, and behind it, where it looks when it turns.
    for x in (end - 3.0, end + 2.5, end + 8.0, end - 14.0, end - 19.5):
        for y in 2.7 * np.arange(-4, 5):
            if rng.random() < 0.5:
                site.put(
                    vehicles.parked_car(rng), x, y + rng.uniform(-0.2, 0.2), rng.integers(2) * np.pi
                )
    put_crossers(site, rng, (-4.0, 4.0), near=0.9)
    put_walkers(site, rng, (1, 4), (-6.0, 6.0))
    put_row(site, rng, pavement_thing, 0.0, 2.5, 0.0, share=0.5, spread=5.0)
    put_street_lamps(site, rng, -rng.uniform(3, 6), 14.0)


def build_carriageway(
    site: Site,
    rng: np.random.Generator,
    right: float,
    left: float,
    lane: float,
    edge_lines: bool = True,
) -> None:
    """Asphalt from `right` to `left` with a dashed middle line, edge lines, perhaps a zebra."""
    far = site.travel_m + REACH_M
    site.build(meshes.patch((-BEHIND_M, far), (right, left), 0.0, m.ASPHALT.draw(rng)))
    paint = m.ROAD_PAINT.draw(rng)
    # Dashes of country roads, towns and crossings; assumed to be as often each.
    period, dash = ((9.0, 4.5), (6.0, 3.0), (4.0, 2.0))[rng.integers(3)]
    for x in np.arange(-2 * period + rng.uniform(0, period), site.travel_m + 50.0, period):
        site.build(meshes.patch((x, x + dash), (lane / 2 - 0.06, lane / 2 + 0.06), PAINT_M, paint))
    if edge_lines:
        for y in (right + 0.2, left - 0.2):
            site.build(meshes.patch((-BEHIND_M, far), (y - 0.06, y + 0.06), PAINT_M, paint))
    if rng.random() < 0.3:
        start = site.travel_m * rng.uniform() + rng.uniform(4, 12)
        # A zebra crossing, above the lines that it crosses.
        for y in np.arange(right + 0.3, left - 0.6, 1.0):
            site.build(meshes.patch((start, start + 3.5), (y, y + 0.5), PAINT_M + 0.002, paint))
    if rng.random() < 0.5:
        build_repairs(site, rng, right, left)
    build_puddles(site, rng, (right, left))


def build_repairs(site: Site, rng: np.random.Generator, right: float, left: float) -> None:
    """Repaired asphalt and manhole covers."""
    for layer in range(rng.integers(1, 5)):
        # Each on a level of its own, so that no two lie in one plane; all of them under paint.
        height = 0.002 + 0.001 * layer
        x, y = rng.uniform(2, 20 + site.travel_m), rng.uniform(right + 0.8, left - 0.8)
        if rng.random() < 0.5:
            tar = m.ASPHALT.draw(rng)
            length, half = rng.uniform(0.8, 4.0), rng.uniform(0.3, 0.7)
            site.build(meshes.patch((x, x + length), (y - half, y + half), height, tar))
        else:
            outline = furniture.regular_polygon(10, 0.33, 0.0)
            disc = [(x + u, y + v, height) for u, v in outline]
            site.build(meshes.polygon(disc, m.DARK_METAL.draw(rng)))


def build_puddles(site: Site, rng: np.random.Generator, y: Range) -> None:
    """Water that stands on wet ground between `y`: the more, the wetter."""
    for _ in range(rng.integers(4, 12) if site.weather.wetness else 0):
        length, half = rng.uniform(0.4, 2.5), rng.uniform(0.2, 0.8) * site.weather.wetness
        x = site.travel_m * rng.uniform() + rng.uniform(2.0, 16.0)
        middle, turn = rng.uniform(y[0] + half, y[1] - half), rng.uniform(0, 2 * np.pi)
        outline = furniture.regular_polygon(9, 1.0, turn)
        disc = [(x + length * u, middle + half * v, PUDDLE_M) for u, v in outline]
        site.build(meshes.polygon(disc, m.WATER.draw(rng)))


def side_walk(
    rng: np.random.Generator, side: int, kerb: float, x: Range, width: float, paving: m.Material
) -> Mesh:
    """A raised pavement beyond a kerb stone; `side` is -1 on the right."""
    stone, inner = m.CONCRETE.draw(rng), kerb + side * 0.15
    across = sorted((kerb, inner))
    outer = sorted((inner, kerb + side * width))
    middle, length = sum(x) / 2, x[1] - x[0]
    return meshes.join(
        [
            meshes.box((length, 0.15, KERB_M), stone, (middle, sum(across) / 2, 0.0)),
            meshes.patch(x, (outer[0], outer[1]), KERB_M, paving),
        ]
    )


def put_facades(site: Site, rng: np.random.Generator, y: float, yaw: float) -> None:
    """Buildings, walls, hedges and gaps along a line."""
    # From behind the ego on, so that the first building does not begin in the picture.
    x = rng.uniform(-12.0, -4.0)
    while x < site.travel_m + 32.0:
        length, kind = rng.uniform(6.0, 12.0), rng.random()
        centre = x + length / 2
        if kind < 0.25:
            glow = SHOP_LIGHTING.draw_in_band(rng) if site.night and rng.random() < 0.6 else 0.0
            site.put(shelters.shop_front(rng, length, glow), centre, y, yaw, KERB_M)
        elif kind < 0.65:
            site.put(buildings.facade(rng, length, site.night), centre, y, yaw, KERB_M)
        elif kind < 0.9:
            site.put(hedge_or_wall(rng, length), centre, y, yaw, KERB_M)
        # Wall to wall, or with an alley between.
        x += length + rng.choice([0.2, 0.2, 3.0])


def backdrop(rng: np.random.Generator) -> Mesh:
    """What a parking bay ends at: wall, facade, garage door, hedge or fence."""
    length, kind = rng.uniform(6.0, 14.0), rng.integers(7)
    if kind == 0:
        return buildings.facade(rng, length)
    if kind == 1:
        return buildings.roller_door(rng)
    if kind == 2:
        return furniture.fence(rng, length)
    if kind == 3:
        return shelters.glass_railing(rng, length)
    if kind == 4:
        return shelters.shop_front(rng, length)
    return hedge_or_wall(rng, length)


def hedge_or_wall(rng: np.random.Generator, length_m: float) -> Mesh:
    """Either, with its front facing +x."""
    if rng.random() < 0.35:
        return plants.hedge(rng, length_m)
    return buildings.wall(rng, length_m, rng.uniform(0.8, 2.6))


def paint_bays(site: Site, rng: np.random.Generator, end: float, width: float) -> None:
    """Lines between parking bays, to both sides of the ego's."""
    paint = m.ROAD_PAINT.draw(rng)
    for i in range(-4, 4):
        y = (i + 0.5) * width
        site.build(meshes.patch((end - 5.2, end - 0.3), (y - 0.05, y + 0.05), PAINT_M, paint))
