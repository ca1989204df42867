"""A parking garage, with the yard before it. The ego's way is along y = 0."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shotenv.world.families.roads import BEHIND_M, PAINT_M, REACH_M, UNDER_ROAD_M
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
GARAGE_LIGHTING = lights.Lighting((50.0, 150.0), {"led": 0.5, "fluorescent": 0.5})
"""Illuminance straight below one ceiling lamp, lx (EN 12464-1: 75 on average); shares assumed."""
SLAB_M = 0.3
"""Thickness of a garage's roof."""
BEAM_M = 0.22
"""How far beams hang below it; nothing that is put down may be higher."""
GATE_M = 4.2
"""Width of a gate that the ego drives through."""
PARAPET_M = 1.2
"""How far a garage's outer wall stands above its ceiling."""
YARD_M = 20.0
"""Longest way that the ego drives outside a hall."""
CLEAR_OF_GATE_M = 4.0
"""Least distance to the gate that a drive comes in by."""
Opening = tuple[tuple[float, float], tuple[float, float]] | None
"""Lower and upper corner (y, z) of where daylight enters."""


def lay_out_garage(site: Site, rng: np.random.Generator) -> None:
    """An aisle between bays with parked cars and pillars, an end wall, perhaps with daylight.

    The ego may turn into another aisle, come in from a yard, or drive out into one.
    """
    height, aisle, depth = rng.uniform(2.25, 2.9), rng.uniform(5.5, 7.0), rng.uniform(4.8, 5.2)
    near = rng.random() < 0.4
    # The power favours short distances: a third of all clips is to be near field, below 6 m.
    end = site.travel_m + (0.7 + 5.0 * rng.uniform() ** 1.5 if near else rng.uniform(8.0, 28.0))
    half, start = aisle / 2 + depth, -10.0
    if site.road.knots:
        # Behind the corner there is room for a car at least.
        end = max(end, site.road.origin_m + 5.0)
    through = rng.random()
    # A way through a gate wants some metres on both sides of it.
    enters = through < 0.2 and site.travel_m > 3.0 and not site.road.knots
    leaves = 0.2 < through < 0.4 and site.travel_m > 3.0 and not site.road.knots
    if enters:
        start = min(site.travel_m * rng.uniform(0.2, 0.8), YARD_M) + CLEAR_OF_GATE_M
        end = max(end, start + 12.0)
    if leaves:
        share, near = rng.uniform(0.3, 0.9), False
        end = max(share * site.travel_m, site.travel_m - YARD_M)
    hall = hall_over(site, start, end, half)
    build_garage_shell(site, rng, hall, height)
    gate = -GATE_M / 2, GATE_M / 2
    entrance = put_gate(site, rng, hall, start, gate, height) if enters else None
    if leaves:
        opening = put_gate(site, rng, hall, end, gate, height)
        site.indoor = hall.indoor(height + SLAB_M, opening, None)
    else:
        build_end_wall(site, rng, hall, height)
        if entrance is not None and site.indoor is not None:
            site.indoor = replace(site.indoor, low=(start, *site.indoor.low[1:]), entrance=entrance)
    first, last = (start, end) if enters else (-10.0, end)
    paint_garage_floor(site, rng, (max(first + 0.3, -4.0), last), aisle, depth)
    bay = rng.uniform(2.5, 2.8)
    for side in (-1, 1):
        put_pillars(site, rng, (first, last), side * (aisle / 2 + 0.5), 2 * bay, height)
    # Only now: walls and pillars reach up to the ceiling that things must stay under.
    site.enclose(
        (first + 0.05 if enters else -10.0, end - 0.05), (-half + 0.05, half - 0.05),
        height - BEAM_M,
    )  # fmt: skip
    for side in (-1, 1):
        put_parked_cars(site, rng, last, side * (aisle / 2 + depth / 2 + 0.2), bay, side)
    if near and rng.random() < 0.5:
        site.put(vehicles.car(rng).at_rest, end - 1.2, rng.uniform(-0.5, 0.5), np.pi / 2)
    build_ceiling_lamps(site, rng, (max(first, -7.0), end), height, (-aisle / 4, aisle / 4))
    for part in site.stretches():
        put_crossers(part, rng, (-aisle / 2, aisle / 2), near=0.8)
        put_walkers(part, rng, (1, 3), (-aisle / 2 + 0.3, aisle / 2 - 0.3))
    if rng.random() < 0.35:
        x = rng.uniform(8.0, 20.0) + site.travel_m
        coming = Pose((x, aisle / 4, 0.0), np.pi)
        put_approaching(site, rng, coming, rng.uniform(0.5, 3.0), vehicles.car)
    put_vehicle_ahead(site, rng)
    put_row(site, rng, low_thing, rng.choice([-1, 1]) * (aisle / 2 - 0.2), 4.0, 0.0, share=0.4)
    if enters:
        lay_out_yard(site, rng, (-BEHIND_M, start))
    if leaves:
        lay_out_yard(site, rng, (end, end + REACH_M))


@dataclass(frozen=True)
class Hall:
    """Ground plan of a hall, a rectangle in the world's axes.

    The last part of the way through it runs along y = 0 and ends before its far wall, at x[1].
    """

    x: Range
    y: Range

    @property
    def middle(self) -> tuple[float, float]:
        """Its centre (x, y)."""
        return sum(self.x) / 2, sum(self.y) / 2

    @property
    def size(self) -> tuple[float, float]:
        """Length along x and along y."""
        return self.x[1] - self.x[0], self.y[1] - self.y[0]

    def indoor(self, top: float, opening: Opening, entrance: Opening) -> Indoor:
        """The space below the roof."""
        # Walls are part of it: what lies on their inner faces is indoors.
        low = self.x[0] if entrance else self.x[0] - 1.0
        return Indoor(
            (low, self.y[0] - 1.0, -1.0), (self.x[1], self.y[1] + 1.0, top), opening, entrance
        )


def hall_over(site: Site, start: float, end: float, half: float) -> Hall:
    """The hall that a way from `start` to `end` runs through, `half` wide to both sides."""
    if not site.road.knots:
        return Hall((start, end), (-half, half))
    # Around a corner the first part of the way runs across the last one, which is on y = 0: the
    # hall reaches from where that begins to beyond the last one.
    (x,), (y,), _ = site.road.at(np.array([start]))
    return Hall((float(x) - half, end), (min(-half, float(y)), max(half, float(y))))


def build_wall(site: Site, mesh: Mesh, x: float, y: float) -> None:
    """A wall that things keep off, or, in the world's axes, one that bounds a hall."""
    if site.road.knots or not site.put(mesh, x, y):
        site.build(meshes.at(mesh, x, y), straight=True)


def put_gate(
    site: Site, rng: np.random.Generator, hall: Hall, x: float, y: Range, height: float
) -> Opening:
    """A wall across the end of a hall at `x`, with an open gate in it."""
    wall, lintel = buildings.wall_material(rng), rng.uniform(0.1, 0.3)
    for low, high in ((hall.y[0] - 1.0, y[0]), (y[1], hall.y[1] + 1.0)):
        side = meshes.box((0.3, high - low, height + PARAPET_M), wall)
        build_wall(site, side, x, (low + high) / 2)
    over = meshes.box((0.3, y[1] - y[0], lintel + PARAPET_M), wall, (x, 0.0, height - lintel))
    site.build(over)
    return (y[0], 0.0), (y[1], height - lintel)


def lay_out_yard(site: Site, rng: np.random.Generator, x: Range) -> None:
    """Paved ground before a gate, with cars, bins, trees and walls around."""
    ground = (m.ASPHALT if rng.random() < 0.6 else m.PAVING).draw(rng)
    # Under the hall's floor by a step, so that nothing is seen between the two.
    under = (x[0], x[1] + 0.5) if x[0] < -1.0 else (x[0] - 0.5, x[1])
    site.build(meshes.patch(under, (-REACH_M, REACH_M), UNDER_ROAD_M, ground), straight=True)
    # Under the open sky again, and on the yard alone.
    site.enclose((x[0], x[1] - 0.3) if x[0] < -1.0 else (x[0] + 0.5, x[1]), (-25.0, 25.0), np.inf)
    near = x[0] if x[0] > -1.0 else x[1] - 20.0
    for along in np.arange(near + 2.0, near + 26.0, 3.0):
        for side in (-1, 1):
            if rng.random() < 0.7:
                thing = draw_one(
                    rng,
                    (vehicles.parked_car, vehicles.parked_car, plants.tree, plants.bush,
                     furniture.rubbish_bin, furniture.pole),
                )  # fmt: skip
                site.put(thing, along, side * rng.uniform(3.0, 12.0), rng.integers(4) * np.pi / 2)
    if x[0] > -1.0:
        facade = buildings.facade(rng, rng.uniform(8.0, 14.0))
        site.put(facade, near + rng.uniform(18.0, 30.0), rng.uniform(-4.0, 4.0), np.pi)


def low_thing(rng: np.random.Generator) -> Mesh:
    """Something that fits under a garage's ceiling."""
    return draw_one(
        rng,
        (furniture.crate, furniture.rubbish_bin, furniture.cone, furniture.bollard, cycles.bicycle,
         furniture.cabinet),
    )  # fmt: skip


def build_garage_shell(site: Site, rng: np.random.Generator, hall: Hall, height: float) -> None:
    """Floor, ceiling with beams and a pipe, walls to three sides."""
    wall, concrete = buildings.wall_material(rng), m.CONCRETE.draw(rng)
    # Coated floors mirror lamps and cars, bare concrete does not.
    floor = (m.CONCRETE if rng.random() < 0.5 else m.COATED_FLOOR).draw(rng)
    (x, y), (length, width) = hall.middle, hall.size
    parts = [
        meshes.patch(hall.x, hall.y, 0.0, floor),
        meshes.box((length, width + 2.0, SLAB_M), concrete, (x, y, height)),
        *(
            meshes.box((0.35, width, BEAM_M), concrete, (along, y, height - BEAM_M))
            for along in np.arange(hall.x[0] + 2.0, hall.x[1], 5.2)
        ),
        *(
            meshes.box((length, 0.3, height), wall, (x, side + out * 0.15, 0.0))
            for side, out in zip(hall.y, (-1, 1), strict=True)
        ),
    ]
    pipe, at = m.METAL.draw(rng), rng.uniform(hall.y[0] + 1.0, hall.y[1] - 1.0)
    parts.append(
        meshes.rod((hall.x[0], at, height - 0.32), (hall.x[1], at, height - 0.32), 0.07, pipe)
    )
    if hall.x[0] < 0.0:
        parts.append(meshes.box((0.3, width, height), wall, (hall.x[0] - 0.15, y, 0.0)))
    site.build(meshes.join(parts), straight=True, sheltered=True)


def build_end_wall(site: Site, rng: np.random.Generator, hall: Hall, height: float) -> None:
    """Closed, or a ramp up into daylight, or a parapet with daylight above it."""
    wall = buildings.wall_material(rng)
    (_, y), (_, width), end = hall.middle, hall.size, hall.x[1]
    kind, lintel, top = rng.random(), rng.uniform(0.2, 0.5), height + SLAB_M
    # What is overhead or beyond the opening is built, nothing has to keep off it.
    if kind < 0.45:
        site.indoor = hall.indoor(top, None, None)
        build_wall(site, meshes.box((0.3, width, height), wall), end + 0.15, y)
        band = meshes.back(hall.y, (0.5, 0.75), end - 0.012, m.WHITE_PAINT.draw(rng))
        site.build(band, straight=True)
        return
    over = meshes.box((0.3, width, lintel), wall, (end + 0.15, y, height - lintel))
    site.build(over, straight=True)
    if kind < 0.7:
        gate = rng.uniform(3.4, 4.6)
        site.indoor = hall.indoor(top, ((-gate / 2, 0.0), (gate / 2, height - lintel)), None)
        for low, high in ((hall.y[0], -gate / 2), (gate / 2, hall.y[1])):
            side = meshes.box((0.3, high - low, height), wall)
            build_wall(site, side, end + 0.15, (low + high) / 2)
        build_ramp(site, rng, end, gate, top, wall)
        return
    parapet = rng.uniform(0.7, 1.1)
    site.indoor = hall.indoor(top, ((hall.y[0], parapet), (hall.y[1], height - lintel)), None)
    build_wall(site, meshes.box((0.3, width, parapet), wall), end + 0.15, y)
    beyond = meshes.patch(
        (end + 0.3, end + REACH_M), (hall.y[0] - REACH_M, hall.y[1] + REACH_M), 0.0,
        m.GRASS.draw(rng),
    )  # fmt: skip
    site.build(beyond, straight=True)
    for across in rng.uniform(-8.0, 8.0, rng.integers(1, 4)):
        site.put(plants.tree(rng), end + rng.uniform(3.0, 12.0), across)


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
    site: Site, rng: np.random.Generator, along: Range, aisle: float, depth: float
) -> None:
    """Painted lines between the bays and a dashed line along the aisle."""
    paint, pitch = m.ROAD_PAINT.draw(rng), 2.6
    for x in np.arange(along[0], along[1] - 0.3, pitch):
        for side in (-1, 1):
            y = sorted((side * aisle / 2, side * (aisle / 2 + depth - 0.3)))
            site.build(meshes.patch((x, x + 0.1), (y[0], y[1]), PAINT_M, paint))
    for x in np.arange(along[0], along[1] - 2.5, 4.0):
        site.build(meshes.patch((x, x + 2.0), (-0.05, 0.05), PAINT_M, paint))


def put_pillars(
    site: Site, rng: np.random.Generator, along: Range, y: float, every_m: float, height: float
) -> None:
    """A line of equal pillars."""
    # One draw for all: pillars of a garage are alike.
    mesh, first = buildings.pillar(rng, height), rng.uniform(0.5, 3.0)
    for x in np.arange(max(along[0], 0.0) + first, along[1] - 0.5, every_m):
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
    lighting: lights.Lighting = GARAGE_LIGHTING,
) -> None:
    """Tubes under a ceiling along x, all of one kind, a few of them dead."""
    intensity = lights.intensity_above(rng, lighting, height)
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
