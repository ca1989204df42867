"""Roofed places: a parking garage and a road tunnel. The ego's lane is centred on y = 0."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shotenv.world.families.roads import BEHIND_M, PAINT_M, REACH_M
from shotenv.world.families.traffic import (
    draw_one,
    put_approaching,
    put_crossers,
    put_row,
    put_vehicle_ahead,
    put_walkers,
)
from shotenv.world.geometry import (
    Indoor,
    Lamp,
    Mesh,
    Pose,
    Site,
    lights,
    materials as m,
    meshes,
)
from shotenv.world.things import buildings, cycles, furniture, plants, vehicles
from unwrap.support import Range

TUBE_LAMP_M = 1.4
TUBE_WIDTH_M = 0.12
TUBE_IRRADIANCE: Range = (5e-3, 0.1)
"""Irradiance in band straight below one ceiling lamp, W m-2; an assumed range."""
SLAB_M = 0.3
"""Thickness of a garage's roof."""
BEAM_M = 0.22
"""How far beams hang below it; nothing that is put down may be higher."""


def lay_out_garage(site: Site, rng: np.random.Generator) -> None:
    """An aisle between bays with parked cars and pillars, an end wall, perhaps with daylight."""
    height, aisle, depth = rng.uniform(2.25, 2.9), rng.uniform(5.5, 7.0), rng.uniform(4.8, 5.2)
    near = rng.random() < 0.4
    # The power favours short distances: a third of all clips is to be near field, below 6 m.
    end = site.travel_m + (0.7 + 5.0 * rng.uniform() ** 1.5 if near else rng.uniform(8.0, 28.0))
    half = aisle / 2 + depth
    build_garage_shell(site, rng, end, half, height)
    paint_garage_floor(site, rng, end, aisle, depth)
    bay = rng.uniform(2.5, 2.8)
    for side in (-1, 1):
        put_pillars(site, rng, end, side * (aisle / 2 + 0.5), 2 * bay, height)
    # Only now: walls and pillars reach up to the ceiling that things must stay under.
    site.enclose((-10.0, end - 0.05), (-half + 0.05, half - 0.05), height - BEAM_M)
    for side in (-1, 1):
        put_parked_cars(site, rng, end, side * (aisle / 2 + depth / 2 + 0.2), bay, side)
    if near and rng.random() < 0.5:
        site.put(vehicles.car(rng).at_rest, end - 1.2, rng.uniform(-0.5, 0.5), np.pi / 2)
    build_ceiling_lamps(site, rng, (-7.0, end), height, (-aisle / 4, aisle / 4))
    put_crossers(site, rng, (-aisle / 2, aisle / 2), near=0.8)
    put_walkers(site, rng, (1, 3), (-aisle / 2 + 0.3, aisle / 2 - 0.3))
    if rng.random() < 0.35:
        x = rng.uniform(8.0, 20.0) + site.travel_m
        start = Pose((x, aisle / 4, 0.0), np.pi)
        put_approaching(site, rng, start, rng.uniform(0.5, 3.0), vehicles.car)
    put_vehicle_ahead(site, rng)
    put_row(site, rng, low_thing, rng.choice([-1, 1]) * (aisle / 2 - 0.2), 4.0, 0.0, share=0.4)


def low_thing(rng: np.random.Generator) -> Mesh:
    """Something that fits under a garage's ceiling."""
    return draw_one(
        rng,
        (furniture.crate, furniture.rubbish_bin, furniture.cone, furniture.bollard, cycles.bicycle,
         furniture.cabinet),
    )  # fmt: skip


def build_garage_shell(
    site: Site, rng: np.random.Generator, end: float, half: float, height: float
) -> None:
    """Floor, ceiling with beams and a pipe, side walls, an end wall that may have an opening."""
    start, wall = -10.0, buildings.wall_material(rng)
    concrete = m.CONCRETE.draw(rng)
    # Coated floors mirror lamps and cars, bare concrete does not.
    floor = (m.CONCRETE if rng.random() < 0.5 else m.COATED_FLOOR).draw(rng)
    site.build(meshes.patch((start, end), (-half, half), 0.0, floor))
    size = (end - start + 2.0, 2 * half + 2.0, SLAB_M)
    site.build(meshes.box(size, concrete, ((start + end) / 2, 0.0, height)))
    for x in np.arange(start + 2.0, end, 5.2):
        site.build(meshes.box((0.35, 2 * half, BEAM_M), concrete, (x, 0.0, height - BEAM_M)))
    pipe, y = m.METAL.draw(rng), rng.uniform(-half + 1.0, half - 1.0)
    site.build(meshes.rod((start, y, height - 0.32), (end, y, height - 0.32), 0.07, pipe))
    for side in (-1, 1):
        site.build(
            meshes.box(
                (end - start, 0.3, height), wall, ((start + end) / 2, side * (half + 0.15), 0.0)
            )
        )
    site.build(meshes.box((0.3, 2 * half, height), wall, (start - 0.15, 0.0, 0.0)))
    build_end_wall(site, rng, end, half, height, wall)


def build_end_wall(
    site: Site, rng: np.random.Generator, end: float, half: float, height: float, wall: m.Material
) -> None:
    """Closed, or a ramp up into daylight, or a parapet with daylight above it."""
    box = (-BEHIND_M, -half - 1.0, -1.0), (end, half + 1.0, height + SLAB_M)
    kind, lintel = rng.random(), rng.uniform(0.2, 0.5)
    # Walls that the ego could meet are put, so that things keep off them; what is overhead or
    # beyond the opening is built.
    if kind < 0.45:
        site.indoor = Indoor(*box, None)
        site.put(meshes.box((0.3, 2 * half, height), wall), end + 0.15, 0.0)
        band = meshes.back((-half, half), (0.5, 0.75), end - 0.012, m.WHITE_PAINT.draw(rng))
        site.build(band)
        return
    site.build(meshes.box((0.3, 2 * half, lintel), wall, (end + 0.15, 0.0, height - lintel)))
    if kind < 0.7:
        width = rng.uniform(3.4, 4.6)
        site.indoor = Indoor(*box, ((-width / 2, 0.0), (width / 2, height - lintel)))
        beside, middle = half - width / 2, (half + width / 2) / 2
        for side in (-1, 1):
            site.put(meshes.box((0.3, beside, height), wall), end + 0.15, side * middle)
        build_ramp(site, rng, end, width, height + SLAB_M, wall)
        return
    parapet = rng.uniform(0.7, 1.1)
    site.indoor = Indoor(*box, ((-half, parapet), (half, height - lintel)))
    site.put(meshes.box((0.3, 2 * half, parapet), wall), end + 0.15, 0.0)
    site.build(
        meshes.patch((end + 0.3, end + REACH_M), (-REACH_M, REACH_M), 0.0, m.GRASS.draw(rng))
    )
    for y in rng.uniform(-8.0, 8.0, rng.integers(1, 4)):
        site.put(plants.tree(rng), end + rng.uniform(3.0, 12.0), y)


def build_ramp(
    site: Site, rng: np.random.Generator, foot: float, width: float, rise: float, wall: m.Material
) -> None:
    """A way up to the street between two walls, with ribs across it; at its top stand trees."""
    # Slopes of 13 to 20 %, as ramps of garages have them.
    length, half = rise / rng.uniform(0.13, 0.20), width / 2
    head, concrete = foot + length, m.CONCRETE.draw(rng)
    slope = [(foot, -half, 0.0), (head, -half, rise), (head, half, rise), (foot, half, 0.0)]
    # Marked by hand as a kind of thing: it is no function of its own that `@thing` could mark.
    site.build(replace(meshes.polygon(slope, concrete), kinds=frozenset({"ramp"})))
    rib = m.DARK_METAL.draw(rng)
    for share in np.arange(0.02, 1.0, 0.45 / length):
        x, z = foot + share * length, share * rise
        site.build(meshes.box((0.04, width - 0.6, 0.02), rib, (x, 0.0, z)))
    for side in (-1, 1):
        size = (length, 0.25, rise + 0.9)
        site.build(meshes.box(size, wall, ((foot + head) / 2 + 0.3, side * (half + 0.13), 0.0)))
    street = m.PAVING.draw(rng)
    site.build(meshes.patch((head, head + REACH_M), (-REACH_M, REACH_M), rise, street))
    for y in rng.uniform(-3.0, 3.0, rng.integers(1, 3)):
        site.build(meshes.at(plants.tree(rng), head + rng.uniform(2.0, 6.0), y, rise))


def paint_garage_floor(
    site: Site, rng: np.random.Generator, end: float, aisle: float, depth: float
) -> None:
    """Painted lines between the bays and a dashed line along the aisle."""
    paint, pitch = m.ROAD_PAINT.draw(rng), 2.6
    for x in np.arange(-4.0, end - 0.3, pitch):
        for side in (-1, 1):
            y = sorted((side * aisle / 2, side * (aisle / 2 + depth - 0.3)))
            site.build(meshes.patch((x, x + 0.1), (y[0], y[1]), PAINT_M, paint))
    for x in np.arange(-4.0, end - 2.5, 4.0):
        site.build(meshes.patch((x, x + 2.0), (-0.05, 0.05), PAINT_M, paint))


def put_pillars(
    site: Site, rng: np.random.Generator, end: float, y: float, every_m: float, height: float
) -> None:
    """A line of equal pillars."""
    # One draw for all: pillars of a garage are alike.
    mesh = buildings.pillar(rng, height)
    for x in np.arange(rng.uniform(0.5, 3.0), end - 0.5, every_m):
        site.put(mesh, x, y)


def put_parked_cars(
    site: Site, rng: np.random.Generator, end: float, y: float, bay: float, side: int
) -> None:
    """Cars across the aisle in some of the bays, either way round."""
    share = rng.uniform(0.3, 0.9)
    for x in np.arange(rng.uniform(0.5, 2.0), min(end - 1.0, site.travel_m + 24.0), bay):
        if rng.random() < share:
            yaw = side * (np.pi / 2) + rng.integers(2) * np.pi
            site.put(vehicles.parked_car(rng), x, y, yaw + rng.uniform(-0.03, 0.03))


def build_ceiling_lamps(
    site: Site,
    rng: np.random.Generator,
    x: tuple[float, float],
    height: float,
    rows: tuple[float, ...],
) -> None:
    """Tubes under a ceiling along x, all of one kind, a few of them dead."""
    intensity = lights.intensity_for(rng, TUBE_IRRADIANCE, height)
    radiance = lights.face_radiance(intensity, TUBE_LAMP_M * TUBE_WIDTH_M)
    casing, pitch = m.WHITE_PAINT.draw(rng), rng.uniform(3.5, 6.0)
    low = height - 0.14
    for along in np.arange(x[0] + 1.5, x[1] - 1.0, pitch):
        for y in rows:
            alive = rng.random() < 0.92  # Assumed.
            tube = buildings.tube_lamp(TUBE_LAMP_M, radiance if alive else 0.0, casing, height)
            site.build(meshes.at(tube, along, y))
            if alive:
                site.lamps.append(
                    Lamp((float(along), y, low - 0.06), intensity, 0.4, cutoff_cos=-0.1)
                )


def lay_out_tunnel(site: Site, rng: np.random.Generator) -> None:
    """A two-lane tube with lamps and kerbs; its exit opens on a road in daylight."""
    lane = rng.uniform(3.0, 3.6)
    centre, half = lane / 2, lane + rng.uniform(0.9, 1.6)
    # The ego may leave the tunnel within the clip or see its exit ahead all the time.
    exit_x = site.travel_m * rng.uniform(0.3, 1.0) + rng.uniform(4.0, 26.0)
    section = tube_section(rng, half)
    build_tube(site, rng, section, centre, exit_x)
    build_tunnel_road(site, rng, centre, half, lane, exit_x)
    height = max(z for _, z in section)
    # From floor to crown, although the vault is narrower above: renderers aim at a rectangle, and
    # what meets the lining instead is in shadow.
    site.indoor = Indoor(
        (-BEHIND_M, centre - half, -1.0),
        (exit_x, centre + half, height),
        ((centre - half, 0.0), (centre + half, height)),
    )
    build_ceiling_lamps(site, rng, (-12.0, exit_x), height - 0.05, (centre,))
    put_wall_things(site, rng, centre - half, exit_x)
    lay_out_beyond_exit(site, rng, centre, half, exit_x)
    put_vehicle_ahead(site, rng)
    if rng.random() < 0.6:
        x = rng.uniform(6.0, 26.0) + 0.5 * site.travel_m
        put_approaching(site, rng, Pose((x, lane, 0.0), np.pi), rng.uniform(3.0, 14.0))
    put_walkers(site, rng, (0, 2), (centre - half + 0.3, centre - half + 0.5), 0.15)


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
    exit_x: float,
) -> None:
    """Lining in rings with darker joints, and brighter tiles low on the walls."""
    lining, joint = m.CONCRETE.draw(rng), m.DARK_METAL.draw(rng)
    site.build(meshes.at(buildings.tunnel_tube(section, (-BEHIND_M, exit_x), lining), 0.0, centre))
    # Joints stand a little inside the lining: two faces in one plane would flicker.
    narrow = [(0.99 * y, 0.995 * z) for y, z in section]
    for x in np.arange(exit_x - 0.3, -2.0, -rng.uniform(4.0, 8.0)):
        site.build(meshes.at(buildings.tunnel_tube(narrow, (x, x + 0.12), joint), 0.0, centre))
    tiles, half = m.WHITE_PAINT.draw(rng), section[-1][0] - 0.02
    if rng.random() < 0.6:
        for side in (-1, 1):
            y = centre + side * half
            ring = [(-BEHIND_M, y, 0.16), (exit_x, y, 0.16), (exit_x, y, 1.6), (-BEHIND_M, y, 1.6)]
            site.build(meshes.polygon(ring[::-side], tiles))


def build_tunnel_road(
    site: Site, rng: np.random.Generator, centre: float, half: float, lane: float, exit_x: float
) -> None:
    """Road surface, raised edges, the middle line and the edge lines."""
    far, stone, paint = site.travel_m + REACH_M, m.CONCRETE.draw(rng), m.ROAD_PAINT.draw(rng)
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
    for x in np.arange(-4.0, exit_x + 40.0, 5.0):
        site.build(meshes.patch((x, x + 2.5), (centre - 0.06, centre + 0.06), PAINT_M, paint))


def put_wall_things(site: Site, rng: np.random.Generator, y: float, exit_x: float) -> None:
    """Cabinets, doors and retro-reflecting marks on the right wall."""
    for x in np.arange(rng.uniform(2.0, 5.0), exit_x - 1.0, rng.uniform(4.0, 9.0)):
        cabinet = meshes.box((rng.uniform(0.5, 1.0), 0.2, 1.1), m.METAL.draw(rng), (0.0, 0.0, 0.15))
        site.put(cabinet, x, y + 0.12)
        marker = meshes.back((y + 0.1, y + 0.3), (0.5, 0.8), x + 2.0, m.RETRO_SHEET.draw(rng))
        site.build(marker)


def lay_out_beyond_exit(
    site: Site, rng: np.random.Generator, centre: float, half: float, exit_x: float
) -> None:
    """Verges, trees, signs and rails beyond the exit."""
    far, verge = site.travel_m + REACH_M, m.GRASS.draw(rng)
    edges = (centre - half - 0.3, centre + half + 0.3)
    for y in ((-REACH_M, edges[0]), (edges[1], REACH_M)):
        site.build(meshes.patch((exit_x, far), y, 0.0, verge))
    for side, edge in ((-1, edges[0]), (1, edges[1])):
        if rng.random() < 0.5:
            rail = furniture.guard_rail(rng, 16.0)
            site.put(rail, exit_x + 9.0, edge + 0.5 * side, -side * np.pi / 2)
        for x in np.arange(exit_x + 2.0, exit_x + 26.0, 5.0):
            thing = plants.tree(rng) if rng.random() < 0.7 else furniture.sign(rng)
            site.put(thing, x, edge + side * rng.uniform(1.6, 6.0), np.pi)
