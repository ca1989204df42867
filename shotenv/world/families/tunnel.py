"""A road tunnel, and the road that leads into it and out of it. The ego's lane is on y = 0."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.families.garage import build_ceiling_lamps
from shotenv.world.families.roads import BEHIND_M, PAINT_M, REACH_M, UNDER_ROAD_M
from shotenv.world.families.traffic import put_approaching, put_vehicle_ahead, put_walkers
from shotenv.world.geometry import (
    Curve,
    Indoor,
    Pose,
    Site,
    ground_speed_m_s,
    lights,
    materials as m,
    meshes,
)
from shotenv.world.things import buildings, furniture, plants
from unwrap.support import Range

TUNNEL_LIGHTING = lights.Lighting((50.0, 300.0), {"led": 0.5, "sodium": 0.4, "fluorescent": 0.1})
"""Illuminance straight below one lamp, lx; all assumed."""


def lay_out_tunnel(site: Site, rng: np.random.Generator) -> None:
    """A two-lane tube with lamps and kerbs; roads in daylight lead into it and out of it.

    The ego drives in it, out of it, into it, or through all of it; the road outside may bend.
    """
    lane = rng.uniform(3.0, 3.6)
    centre, half = lane / 2, lane + rng.uniform(0.9, 1.6)
    tube = draw_tube_ends(site, rng)
    site.road = bends_outside(site, rng, tube)
    section = tube_section(rng, half)
    build_tube(site, rng, section, centre, tube)
    build_tunnel_road(site, rng, centre, half, lane, tube)
    height = max(z for _, z in section)
    # From floor to crown, although the vault is narrower above: renderers aim at a rectangle, and
    # what meets the lining instead is in shadow.
    mouth = (centre - half, 0.0), (centre + half, height)
    site.indoor = Indoor(
        (tube[0], centre - half, -1.0),
        (tube[1], centre + half, height),
        mouth,
        mouth if tube[0] > -BEHIND_M else None,
    )
    lit = max(tube[0], -12.0), tube[1]
    build_ceiling_lamps(site, rng, lit, height - 0.05, (centre,), TUNNEL_LIGHTING)
    put_wall_things(site, rng, centre - half, tube)
    edges = centre - half - 0.3, centre + half + 0.3
    site.build_ground(m.GRASS.draw(rng), UNDER_ROAD_M)
    lay_out_verges(site, rng, edges, (tube[1] + 2.0, max(tube[1], site.travel_m) + 28.0))
    if tube[0] > -BEHIND_M:
        build_portal(site, rng, section, centre, tube)
        lay_out_verges(site, rng, edges, (1.0, tube[0] - 8.0))
    put_vehicle_ahead(site, rng)
    for part in site.stretches():
        if rng.random() < 0.6:
            x = rng.uniform(6.0, 26.0) + 0.5 * part.travel_m
            put_approaching(part, rng, Pose((x, lane, 0.0), np.pi), rng.uniform(3.0, 14.0))
        put_walkers(part, rng, (0, 2), (centre - half + 0.3, centre - half + 0.5), 0.15)


def draw_tube_ends(site: Site, rng: np.random.Generator) -> Range:
    """Where along the road a tunnel begins and ends."""
    kind, travel = rng.random(), site.travel_m
    if kind < 0.35:
        # Its mouth is ahead at the start, and the ego is inside at the end if it drives so far.
        entry = max(5.0, travel * rng.uniform(0.2, 0.8)) + rng.uniform(0.0, 6.0)
        return entry, entry + (rng.uniform(14.0, 50.0) if rng.random() < 0.4 else 180.0)
    if kind < 0.85:
        # The ego may leave the tunnel within the clip or see its exit ahead all the time.
        return -BEHIND_M, travel * rng.uniform(0.3, 1.0) + rng.uniform(4.0, 26.0)
    return -BEHIND_M, travel + REACH_M


def bends_outside(site: Site, rng: np.random.Generator, tube: Range) -> Curve:
    """A road that is straight in its tunnel and may bend before it and behind it."""
    knots: list[tuple[float, float]] = []
    # The ego is nowhere faster than all along at its top speed.
    fastest = max(abs(ground_speed_m_s(site.ego, time)) for time in site.times)
    least = max(70.0, fastest**2 / 2.0)
    for first, last in ((tube[0] - 75.0, tube[0] - 6.0), (tube[1] + 8.0, tube[1] + 90.0)):
        if rng.random() < 0.7 and last > -20.0:
            curvature = float(rng.choice([-1.0, 1.0]) / rng.uniform(least, 3.0 * least))
            ease = (last - first) / 4
            knots += [(first, 0.0), (first + ease, curvature), (last - ease, curvature),
                      (last, 0.0)]  # fmt: skip
    return Curve(tuple(knots), origin_m=tube[1])


def tube_section(rng: np.random.Generator, half: float) -> list[tuple[float, float]]:
    """A vault or a rectangle."""
    if rng.random() < 0.6:
        return buildings.arch(half, rng.uniform(2.2, 3.0), rng.uniform(4.8, 5.8))
    height = rng.uniform(4.2, 5.2)
    return [(-half, 0.0), (-half, height), (half, height), (half, 0.0)]


def build_tube(
    site: Site,
    rng: np.random.Generator,
    section: list[tuple[float, float]],
    centre: float,
    tube: Range,
) -> None:
    """Lining in rings with darker joints, and brighter tiles low on the walls."""
    lining, joint, (entry_x, exit_x) = m.CONCRETE.draw(rng), m.DARK_METAL.draw(rng), tube
    site.build(meshes.at(buildings.tunnel_tube(section, tube, lining), 0.0, centre))
    # Joints stand a little inside the lining: two faces in one plane would flicker.
    narrow = [(0.99 * y, 0.995 * z) for y, z in section]
    for x in np.arange(exit_x - 0.3, max(entry_x, -2.0), -rng.uniform(4.0, 8.0)):
        site.build(meshes.at(buildings.tunnel_tube(narrow, (x, x + 0.12), joint), 0.0, centre))
    tiles, half = m.WHITE_PAINT.draw(rng), section[-1][0] - 0.02
    if rng.random() < 0.6:
        for side in (-1, 1):
            y = centre + side * half
            ring = [(entry_x, y, 0.16), (exit_x, y, 0.16), (exit_x, y, 1.6), (entry_x, y, 1.6)]
            site.build(meshes.polygon(ring[::-side], tiles))


def build_tunnel_road(
    site: Site, rng: np.random.Generator, centre: float, half: float, lane: float, tube: Range
) -> None:
    """Road surface, raised edges, the middle line and the edge lines."""
    far, stone, paint = (
        max(site.travel_m, tube[1]) + REACH_M,
        m.CONCRETE.draw(rng),
        m.ROAD_PAINT.draw(rng),
    )
    site.build(
        meshes.patch(
            (-BEHIND_M, far), (centre - half - 0.3, centre + half + 0.3), 0.0, m.ASPHALT.draw(rng)
        )
    )
    width = half - lane
    for side in (-1, 1):
        size, middle = (far + BEHIND_M, width, 0.15), (far - BEHIND_M) / 2
        site.build(meshes.box(size, stone, (middle, centre + side * (half - width / 2), 0.0)))
        y = centre + side * (lane - 0.15)
        site.build(meshes.patch((-BEHIND_M, far), (y - 0.06, y + 0.06), PAINT_M, paint))
    for x in np.arange(-4.0, max(tube[1], site.travel_m) + 40.0, 5.0):
        site.build(meshes.patch((x, x + 2.5), (centre - 0.06, centre + 0.06), PAINT_M, paint))


def put_wall_things(site: Site, rng: np.random.Generator, y: float, tube: Range) -> None:
    """Cabinets, doors and retro-reflecting marks on the right wall."""
    first = max(tube[0], 0.0) + rng.uniform(2.0, 5.0)
    for x in np.arange(first, tube[1] - 3.0, rng.uniform(4.0, 9.0)):
        cabinet = meshes.box((rng.uniform(0.5, 1.0), 0.2, 1.1), m.METAL.draw(rng), (0.0, 0.0, 0.15))
        site.put(cabinet, x, y + 0.12)
        marker = meshes.back((y + 0.1, y + 0.3), (0.5, 0.8), x + 2.0, m.RETRO_SHEET.draw(rng))
        site.build(marker)


def build_portal(
    site: Site,
    rng: np.random.Generator,
    section: list[tuple[float, float]],
    centre: float,
    tube: Range,
) -> None:
    """The mouth of a tunnel as one drives in: a head wall in a slope, and the hill above it."""
    half, crown = section[-1][0], max(z for _, z in section)
    wide, top, x = half + rng.uniform(1.5, 4.0), crown + rng.uniform(0.8, 1.8), tube[0]
    rim = [_on_rectangle(point, wide, top, crown / 2) for point in section]
    wall = (m.CONCRETE if rng.random() < 0.6 else m.BRICK).draw(rng)
    face = [
        meshes.polygon([(x, *a), (x, *b), (x, *d), (x, *c)], wall)
        for (a, b), (c, d) in zip(pairwise(section), pairwise(rim), strict=True)
    ]
    hill, deep, reach = m.GRASS.draw(rng), min(40.0, tube[1] - x), REACH_M / 2
    slopes = [meshes.patch((x, x + deep), (-reach, reach), top, hill)]
    for side in (-1, 1):
        foot, shoulder = (x - 3.0, side * wide, 0.0), (x + 1.5, side * wide, top)
        far = [(x + 1.5, side * reach, top), (x - 3.0, side * reach, 0.0)]
        slopes.append(meshes.polygon([foot, shoulder, *far][::-side], hill))
        # A wing wall holds the slope beside the road.
        wing = [foot, (x, side * wide, 0.0), (x, side * wide, top), shoulder]
        slopes.append(meshes.polygon(wing[:3], wall))
    site.build(meshes.at(meshes.join([*face, *slopes]), 0.0, centre), straight=True)


def _on_rectangle(
    point: tuple[float, float], half: float, top: float, middle: float
) -> tuple[float, float]:
    """Where the ray from (0, `middle`) through a point leaves a rectangle on the ground."""
    y, z = point
    if z <= middle:
        return float(np.copysign(half, y)), z
    scale = min(half / max(abs(y), 1e-9), (top - middle) / (z - middle))
    return y * scale, middle + (z - middle) * scale


def lay_out_verges(site: Site, rng: np.random.Generator, edges: Range, x: Range) -> None:
    """Trees, signs and rails beside the road where it is open."""
    for side, edge in zip((-1, 1), edges, strict=True):
        if rng.random() < 0.5:
            rail = furniture.guard_rail(rng, 16.0)
            site.put(rail, x[0] + 9.0, edge + 0.5 * side, -side * np.pi / 2)
        for along in np.arange(x[0], x[1], 5.0):
            thing = plants.tree(rng) if rng.random() < 0.7 else furniture.sign(rng)
            site.put(thing, along, edge + side * rng.uniform(1.6, 6.0), np.pi)
