"""A warehouse: aisles between racks, fork lifts, docks. Held out from training."""

from __future__ import annotations

import numpy as np

from shotenv.world.families.construction import passing_worker
from shotenv.world.families.garage import YARD_M, Hall, build_wall, hall_over, lay_out_yard
from shotenv.world.families.roads import PAINT_M, REACH_M
from shotenv.world.families.traffic import (
    TRIES,
    draw_one,
    put_crossers,
    put_driver,
    put_row,
    put_walkers,
)
from shotenv.world.geometry import (
    Lamp,
    Material,
    Mesh,
    Mover,
    Pose,
    Rigid,
    Site,
    lights,
    materials as m,
    meshes,
)
from shotenv.world.things import axle, people

RACK_DEPTH_M = 1.1
BAY_M = 2.7
"""Width of a rack's bay: room for two pallets side by side."""
LAMP_M = (0.6, 0.4)
"""Length and width of the glowing face of a high-bay lamp."""
HIGH_BAY_LIGHTING = lights.Lighting(
    (150.0, 300.0), {"led": 0.6, "fluorescent": 0.2, "metal_halide": 0.2}
)
"""Illuminance straight below one lamp, lx (EN 12464-1: 100 to 300 in stores); shares assumed."""


def lay_out_warehouse(site: Site, rng: np.random.Generator) -> None:
    """An aisle between racks that ends at docks."""
    aisle, height = rng.uniform(3.2, 4.4), rng.uniform(5.5, 8.5)
    # Many clips end close by: near distances would be rare otherwise.
    near = rng.random() < 0.4
    end = site.travel_m + (1.0 + 5.0 * rng.uniform() if near else rng.uniform(9.0, 28.0))
    if site.road.knots:
        # Behind the corner there is room for a pallet truck at least.
        end = max(end, site.road.origin_m + 4.0)
    half = aisle / 2 + 2 * RACK_DEPTH_M + 2.8
    # Straight on through the open gate of a dock, into the yard.
    leaves = rng.random() < 0.25 and site.travel_m > 3.0 and not site.road.knots
    if leaves:
        end = max(site.travel_m * rng.uniform(0.4, 0.9), site.travel_m - YARD_M) + 0.5
    hall = hall_over(site, -12.0, end, half)
    build_hall_shell(site, rng, hall, height)
    build_docks(site, rng, hall, height, leaves)
    paint_aisle(site, rng, end, aisle)
    site.enclose((-10.0, end - 0.05), (-half + 0.05, half - 0.05), height - 0.5)
    for part in site.stretches():
        put_crossers(part, rng, (-aisle / 2, aisle / 2), near=0.8, draw=passing_worker)
        put_fork_lift(part, rng, end, aisle)
        put_walkers(part, rng, (0, 3), (-aisle / 2 + 0.3, aisle / 2 - 0.3), draw=passing_worker)
    for side in (-1, 1):
        y = side * (aisle / 2 + RACK_DEPTH_M / 2 + 0.1)
        put_row(site, rng, floor_thing, side * (aisle / 2 - 0.35), 3.0, 0.0, share=0.35)
        # Racks further off would fill the budget of triangles for a few pixels.
        for x in np.arange(-1.0, min(end - 3.0, site.travel_m + 24.0), BAY_M + 0.02):
            site.put(pallet_rack(rng, min(3, int((height - 1.0) / 1.7))), x, y, -side * np.pi / 2)
    for y in np.arange(-half + 1.5, half - 1.0, 1.7):
        site.put(floor_thing(rng), end - rng.uniform(1, 2.2), y)
    build_high_bays(site, rng, end, height)
    if leaves:
        lay_out_yard(site, rng, (end, end + REACH_M))


def build_hall_shell(site: Site, rng: np.random.Generator, hall: Hall, height: float) -> None:
    """Floor, clad walls to three sides, a roof on trusses."""
    cladding, roof, steel = m.METAL.draw(rng), m.WHITE_PAINT.draw(rng), m.METAL.draw(rng)
    (x, y), (length, width) = hall.middle, hall.size
    parts = [
        # To the threshold of the gates, under the end wall.
        meshes.patch((hall.x[0], hall.x[1] + 0.3), hall.y, 0.0, m.COATED_FLOOR.draw(rng)),
        meshes.box((length, width + 1.0, 0.3), roof, (x, y, height)),
        meshes.box((0.3, width, height), cladding, (hall.x[0] - 0.15, y, 0.0)),
    ]
    for along in np.arange(hall.x[0] + 3.0, hall.x[1], 6.0):
        parts.append(meshes.box((0.2, width, 0.45), steel, (along, y, height - 0.45)))
        parts += [
            meshes.box((0.3, 0.3, height), steel, (along, side - out * 0.15, 0.0))
            for side, out in zip(hall.y, (-1, 1), strict=True)
        ]
    parts += [
        meshes.box((length, 0.3, height), cladding, (x, side + out * 0.15, 0.0))
        for side, out in zip(hall.y, (-1, 1), strict=True)
    ]
    site.build(meshes.join(parts), straight=True, sheltered=True)


def build_docks(
    site: Site, rng: np.random.Generator, hall: Hall, height: float, leaves: bool
) -> None:
    """The end wall with three gates, the middle one perhaps open on a yard in daylight."""
    width, high, is_open = 3.0, 3.4, leaves or rng.random() < 0.45
    opening = ((-width / 2, 0.0), (width / 2, high)) if is_open else None
    site.indoor = hall.indoor(height + 0.3, opening, None)
    wall, end = m.METAL.draw(rng), hall.x[1]
    for side, low, outer in ((-1, hall.y[0], -width / 2), (1, width / 2, hall.y[1])):
        part = meshes.box((0.3, outer - low, height), wall)
        build_wall(site, part, end + 0.15, (low + outer) / 2)
        door = meshes.at(dock_door(rng, width), end - 0.02, side * 4.2, yaw=np.pi)
        site.build(door, straight=True)
    lintel = meshes.box((0.3, width, height - high), wall, (end + 0.15, 0.0, high))
    site.build(lintel, straight=True)
    if leaves:
        return
    if is_open:
        yard = (end, end + REACH_M), (hall.y[0] - REACH_M, hall.y[1] + REACH_M)
        # A little lower, so that it does not lie in one plane with the floor at the threshold.
        site.build(meshes.patch(*yard, -0.01, m.ASPHALT.draw(rng)), straight=True)
        return
    site.build(meshes.box((0.1, width, high), wall, (end + 0.25, 0.0, 0.0)), straight=True)
    site.build(meshes.at(dock_door(rng, width), end + 0.1, 0.0, yaw=np.pi), straight=True)


@meshes.thing
def dock_door(rng: np.random.Generator, width_m: float) -> Mesh:
    """A sectional door with a row of small panes between two buffers of rubber."""
    light, rubber, glass = m.WHITE_PAINT.draw(rng), m.RUBBER.draw(rng), m.GLASS.draw(rng)
    half = width_m / 2
    sections = [meshes.box((0.05, width_m, 0.55), light, (0.03, 0.0, 0.551 * i)) for i in range(6)]
    panes = [
        meshes.front((y, y + 0.4), (1.8, 2.1), 0.062, glass) for y in np.arange(-1.2, 1.0, 0.6)
    ]
    sides = [meshes.box((0.2, 0.2, 3.4), rubber, (0.1, y, 0.0)) for y in (-half, half)]
    return meshes.join([*sections, *panes, *sides])


def paint_aisle(site: Site, rng: np.random.Generator, end: float, aisle: float) -> None:
    """Painted edges of the aisle."""
    paint = m.ROAD_PAINT.draw(rng)
    for y in (-aisle / 2 + 0.1, aisle / 2 - 0.1):
        site.build(meshes.patch((-10.0, end - 0.3), (y - 0.05, y + 0.05), PAINT_M, paint))


def floor_thing(rng: np.random.Generator) -> Mesh:
    """Something left beside the aisle."""
    return draw_one(rng, (pallet, pallet, drum, pallet_jack))


def put_fork_lift(site: Site, rng: np.random.Generator, end: float, aisle: float) -> None:
    """Perhaps a fork lift in the aisle, coming, going or standing."""
    if rng.random() < 0.2:
        return
    truck = fork_lift(rng)
    for _ in range(TRIES):
        speed = rng.uniform(0.8, 3.0) if rng.random() < 0.8 else 0.0
        x, yaw = site.travel_m + rng.uniform(4.0, 14.0), rng.integers(2) * np.pi
        # 0.9 m is half of its width and some clearance.
        offset = (aisle / 2 - 0.9) * rng.uniform(-0.6, 1.0)
        if put_driver(site, truck, Pose((min(x, end - 3.0), offset, 0.0), yaw), speed):
            return


def build_high_bays(site: Site, rng: np.random.Generator, end: float, height: float) -> None:
    """Lamps under the roof along the aisle."""
    drop = height - 0.6
    intensity = lights.intensity_above(rng, HIGH_BAY_LIGHTING, drop)
    radiance, metal = lights.face_radiance(intensity, LAMP_M[0] * LAMP_M[1]), m.METAL.draw(rng)
    for x in np.arange(-5.0, end - 1.0, rng.uniform(4.0, 6.5)):
        site.build(high_bay(metal, radiance, float(x), drop))
        site.lamps.append(Lamp((float(x), 0.0, drop - 0.1), intensity, 0.4, cutoff_cos=0.2))


def high_bay(metal: Material, radiance: float, x: float, z: float) -> Mesh:
    """A lamp in a flat housing that hangs at height `z`."""
    half, wide = LAMP_M[0] / 2, LAMP_M[1] / 2
    ring = [(x - half, -wide), (x - half, wide), (x + half, wide), (x + half, -wide)]
    face = meshes.polygon([(*corner, z - 0.01) for corner in ring], metal.glowing(radiance))
    return meshes.join(
        [meshes.box((LAMP_M[0] + 0.1, LAMP_M[1] + 0.1, 0.12), metal, (x, 0, z)), face]
    )


@meshes.thing
def pallet_rack(rng: np.random.Generator, levels: int) -> Mesh:
    """One bay of shelves along y with goods on pallets; a few places are empty."""
    frame, beam, half = m.METAL.draw(rng), m.MACHINE_PAINT.draw(rng), BAY_M / 2
    step, deep = 1.7, RACK_DEPTH_M / 2
    parts = [
        meshes.box((0.09, 0.09, step * levels + 0.4), frame, (x, y, 0.0))
        for x in (-deep + 0.05, deep - 0.05)
        for y in (-half + 0.06, half - 0.06)
    ]
    for level in range(levels):
        z = step * level
        # The lowest pallets stand on the floor, without beams.
        if level:
            parts += [
                meshes.box((0.05, BAY_M - 0.2, 0.12), beam, (x, 0.0, z - 0.12))
                for x in (-deep + 0.05, deep - 0.05)
            ]
        parts += [
            meshes.at(load(rng), rng.uniform(-0.05, 0.05), y, z)
            for y in (-0.65, 0.65)
            if rng.random() < 0.8
        ]
    return meshes.join(parts)


def load(rng: np.random.Generator) -> Mesh:
    """A pallet's slab with a block of cartons or sacks, some wrapped in glossy film."""
    height = rng.uniform(0.4, 1.25)
    goods = (m.CARDBOARD, m.CARDBOARD, m.PLASTIC, m.CLOTHES, m.DARK_CLOTHES)[rng.integers(5)]
    size = (rng.uniform(0.75, 1.0), rng.uniform(0.8, 1.1), height)
    block = meshes.box(size, goods.draw(rng), (0.0, 0.0, 0.141))
    return meshes.join([meshes.box((0.95, 1.15, 0.14), m.WOOD.draw(rng)), block])


@meshes.thing
def pallet(rng: np.random.Generator) -> Mesh:
    """A pallet on the floor: boards on blocks, empty, stacked or loaded with cartons."""
    wood, card = m.WOOD.draw(rng), m.CARDBOARD.draw(rng)
    layers = rng.integers(1, 7) if rng.random() < 0.3 else 1
    parts = []
    for z in 0.15 * np.arange(layers):
        parts += [meshes.box((1.2, 0.1, 0.1), wood, (0.0, y, z)) for y in (-0.35, 0.0, 0.35)]
        parts.append(meshes.box((1.2, 0.8, 0.04), wood, (0.0, 0.0, z + 0.10)))
    top = 0.15 * layers - 0.009
    if layers == 1 and rng.random() < 0.7:
        for x in (-0.3, 0.3):
            sizes = rng.uniform(0.3, 0.9, 2)
            parts.append(meshes.box((0.55, 0.7, sizes[0]), card, (x, 0.0, top)))
            parts.append(meshes.box((0.4, 0.5, 0.4 * sizes[1]), card, (x, 0.0, top + sizes[0])))
    return meshes.join(parts)


@meshes.thing
def drum(rng: np.random.Generator) -> Mesh:
    """One or a few steel drums with their ribs."""
    spots = ((0.0, 0.0), (0.62, 0.05), (0.28, 0.55))[: rng.integers(1, 4)]
    profile = [
        (0.29, 0.0), (0.29, 0.29), (0.305, 0.31), (0.29, 0.33),
        (0.29, 0.58), (0.305, 0.60), (0.29, 0.62), (0.29, 0.88), (0.0, 0.88),
    ]  # fmt: skip
    return meshes.join(
        meshes.lathe(profile, m.MACHINE_PAINT.draw(rng), (x, y, 0.0), sections=10) for x, y in spots
    )


@meshes.thing
def pallet_jack(rng: np.random.Generator) -> Mesh:
    """A hand truck: two forks close to the floor and a tiller."""
    paint, tyre = m.MACHINE_PAINT.draw(rng), m.RUBBER.draw(rng)
    forks = [meshes.box((1.15, 0.16, 0.06), paint, (0.0, y, 0.08)) for y in (-0.2, 0.2)]
    rollers = [meshes.box((0.12, 0.1, 0.08), tyre, (x, y, 0.0)) for x in (0.5, -0.6)
               for y in (-0.2, 0.2)]  # fmt: skip
    head = meshes.box((0.25, 0.4, 0.35), paint, (-0.65, 0.0, 0.081))
    tiller = meshes.rod((-0.7, 0.0, 0.4), (-1.0, 0.0, 1.15), 0.025, m.DARK_METAL.draw(rng), 5)
    grip = meshes.rod((-1.0, -0.18, 1.15), (-1.0, 0.18, 1.15), 0.02, tyre, sections=5)
    return meshes.join([*forks, *rollers, head, tiller, grip])


@meshes.thing
def fork_lift(rng: np.random.Generator) -> Mover:
    """A counterbalanced truck with mast, forks, overhead guard and driver, perhaps a load."""
    paint, dark, tyre = m.MACHINE_PAINT.draw(rng), m.DARK_METAL.draw(rng), m.TYRE.draw(rng)
    lift = rng.uniform(0.08, 0.4)
    body = [(-1.05, 0.25), (0.75, 0.2), (0.75, 0.55), (-0.2, 0.75), (-1.05, 1.0)]
    posts = [
        meshes.rod((x, y, 0.6), (top, y, 2.1), 0.035, dark, sections=5)
        for x, top in ((0.7, 0.5), (-0.9, -0.7))
        for y in (-0.45, 0.45)
    ]
    masts = [meshes.box((0.12, 0.1, 2.2), dark, (0.9, y, 0.06)) for y in (-0.3, 0.3)]
    forks = [meshes.box((1.05, 0.12, 0.05), dark, (1.5, y, lift)) for y in (-0.3, 0.3)]
    driver = [
        people.torso(rng, (-0.25, 0.0, 0.85)),
        people.head(rng, (-0.22, 0.0, 1.70)),
    ]
    parts = [
        meshes.extrude(body, 1.1, paint),
        *posts,
        *masts,
        *forks,
        *driver,
        meshes.box((1.3, 1.0, 0.06), dark, (-0.1, 0.0, 2.1)),
        meshes.box((0.08, 0.8, 0.5), dark, (1.0, 0.0, lift)),
    ]
    if rng.random() < 0.5:
        parts.append(meshes.at(load(rng), 1.55, 0.0, lift + 0.06))
    wheels = (axle(x, 0.53, 0.28, tyre, paint) for x in (0.5, -0.7))
    return Mover((Rigid(meshes.join(parts)), *wheels))
