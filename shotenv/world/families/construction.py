"""A construction site: machines, fences, heaps, pipes, scaffolds. Held out from training."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.families.roads import BEHIND_M, REACH_M, build_puddles
from shotenv.world.families.traffic import TRIES, draw_one, put_driver, put_row, strolling
from shotenv.world.geometry import (
    Lamp,
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

FLOOD_LIGHTING = lights.Lighting((20.0, 100.0), {"led": 0.5, "halogen": 0.3, "metal_halide": 0.2})
"""Illuminance of a flood light, at a distance of twice its height, lx; all assumed."""


def lay_out_construction_site(site: Site, rng: np.random.Generator) -> None:
    """A haul road over bare ground between fences, machines, heaps and an unfinished building."""
    ground = (m.SOIL if rng.random() < 0.6 else m.GRAVEL).draw(rng)
    far, half = site.travel_m + REACH_M, rng.uniform(2.6, 4.2)
    site.build_ground(ground)
    track = m.GRAVEL.draw(rng)
    site.build(meshes.patch((-BEHIND_M, far), (-half, half), 0.004, track))
    build_puddles(site, rng, (-half, half))
    if rng.random() < 0.5:
        put_blockage(site, rng)
    for part in site.stretches():
        put_machines(part, rng, half)
        put_crew(part, rng, half)
    # The building stands on one side of the road, and the fence on the other.
    side = rng.choice([-1, 1])
    inwards = -side * np.pi / 2
    put_row(site, rng, lambda r: unfinished_wall(r, 6.0), side * (half + 4.5), 6.3, inwards)
    put_row(site, rng, scaffold, side * (half + 2.2), 2.6, inwards, share=0.7, spread=0.02)
    put_row(site, rng, site_fence, -side * (half + 3.0), 3.55, -inwards, share=0.9, spread=0.1)
    put_row(site, rng, stored_thing, -side * (half + 0.9), 2.6, 0.0, share=0.8, spread=0.8)
    put_row(site, rng, stored_thing, side * (half + 0.6), 3.4, 0.0, share=0.6, spread=0.3)
    put_row(site, rng, gravel_heap, -side * (half + 7.0), 7.0, 0.0, share=0.8, spread=1.5)
    if site.night or rng.random() < 0.3:
        put_flood_light(site, rng, half)


def put_blockage(site: Site, rng: np.random.Generator) -> None:
    """What ends the way: barrier boards, a heap or a container."""
    x = site.travel_m + 1.2 + 7.0 * rng.uniform() ** 1.5
    thing = draw_one(rng, (barrier_board, barrier_board, gravel_heap, site_container))
    site.put(thing, x - float(thing.corners[..., 0].min()), rng.uniform(-0.8, 0.8), np.pi)


def put_machines(site: Site, rng: np.random.Generator, half: float) -> None:
    """An excavator at work or parked beside the road, and perhaps a dumper on it."""
    for _ in range(rng.integers(1, 3)):
        side, digger = rng.choice([-1, 1]), excavator(rng)
        for _ in range(TRIES):
            x = site.travel_m + rng.uniform(3.0, 16.0)
            if site.put(digger, x, side * (half + rng.uniform(0.2, 2.0)), rng.uniform(-3.1, 3.1)):
                break
    if rng.random() < 0.6:
        speed = rng.uniform(1.0, 5.0) if rng.random() < 0.6 else 0.0
        x = rng.uniform(6.0, 20.0) + 0.5 * site.travel_m
        offset = rng.uniform(0.3, 1.0) * (half - 1.2)
        put_driver(site, dumper(rng), Pose((x, offset, 0.0), np.pi), speed)


def put_crew(site: Site, rng: np.random.Generator, half: float) -> None:
    """Workers who stand or walk about."""
    for _ in range(rng.integers(1, 5)):
        somebody, speed = passing_worker(rng)
        for _ in range(TRIES):
            place = (site.travel_m + rng.uniform(1.2, 14.0), rng.uniform(-half, half), 0.004)
            start = Pose(place, rng.uniform(-np.pi, np.pi))
            if site.put_moving(somebody, strolling(site, rng, start, speed)):
                break


def passing_worker(rng: np.random.Generator, wetness: float = 0.0) -> tuple[Mover, float]:
    """A worker who stands or walks, and their speed in m/s; rain makes no difference."""
    speed = rng.uniform(0.5, 1.6) if rng.random() < 0.6 else 0.0
    return worker(rng), speed


def put_flood_light(site: Site, rng: np.random.Generator, half: float) -> None:
    """A mast with lamps that look down the road; lit at night."""
    height = rng.uniform(3.5, 5.5)
    # It shines obliquely along the road, so that what it lights is further off than its height.
    intensity = lights.intensity_above(rng, FLOOD_LIGHTING, 2 * height) if site.night else 0.0
    x, side = site.travel_m + rng.uniform(4.0, 12.0), rng.choice([-1, 1])
    mesh = light_tower(rng, height, lights.face_radiance(intensity, 0.24))
    if site.put(mesh, x, side * (half + 0.7), np.pi) and intensity:
        towards = (-0.6, -0.4 * side, -0.7)
        place = (x - 0.4, side * (half + 0.7), height)
        site.lamps.append(Lamp(place, intensity, 0.4, towards, cutoff_cos=0.3))


def stored_thing(rng: np.random.Generator) -> Mesh:
    """Something that stands about on a site."""
    return draw_one(
        rng, (pipe_stack, barrier_board, block_stack, site_container, portable_toilet, gravel_heap)
    )


@meshes.thing
def worker(rng: np.random.Generator) -> Mover:
    """Somebody in a helmet and a vest with two retro-reflecting hoops."""
    vest, tape = m.CLOTHES.draw(rng), m.RETRO_SHEET.draw(rng)
    trunk = [(0.0, 0.0), (0.18, 0.0), (0.17, 0.15), (0.22, 0.5), (0.19, 0.62), (0.0, 0.70)]
    hoops = [[(0.188, 0.20), (0.196, 0.26)], [(0.213, 0.36), (0.221, 0.42)]]
    body = [meshes.lathe(trunk, vest, sections=10)]
    # A few millimetres off the vest, and pressed flat along with it.
    body += [meshes.lathe(hoop, tape, sections=10) for hoop in hoops]
    upright = meshes.at(meshes.scaled(meshes.join(body), (0.62, 1.0, 1.0)), 0.0, 0.0, 0.80)
    whole = meshes.join([upright, people.head(rng, (0.02, 0.0, 1.62), helmet=True)])
    height, reach = people.HEIGHT_M * rng.uniform(0.92, 1.08), rng.choice([0.0, 0.0, 0.35])
    return Mover((people.walking(rng, whole, height, 1.0, reach),))


@meshes.thing
def excavator(rng: np.random.Generator) -> Mesh:
    """A digger on tracks: cab, engine, and boom, arm and bucket in some posture."""
    paint, dark, glass = m.MACHINE_PAINT.draw(rng), m.DARK_METAL.draw(rng), m.GLASS.draw(rng)
    reach, lift, scale = rng.uniform(0.6, 1.0), rng.uniform(0.0, 0.8), rng.uniform(0.6, 1.0)
    track = [(-1.5, 0.3), (-1.2, 0.0), (1.2, 0.0), (1.5, 0.3), (1.4, 0.7), (-1.4, 0.7)]
    # Joints of the boom in the plane of symmetry, (x, z) before all is scaled.
    elbow = (2.0 + 1.2 * reach, 3.0 + lift)
    wrist = (elbow[0] + 1.0 * reach, 1.0 + lift)
    bucket = [(-0.5, 0.05), (0.1, 0.0), (0.35, 0.5), (0.1, 0.85)]
    parts = [
        # Tracks, undercarriage, upper structure, cab with its panes, boom, arm, bucket.
        *(meshes.at(meshes.extrude(track, 0.5, dark), 0.0, y) for y in (-0.95, 0.95)),
        meshes.box((1.6, 1.5, 0.35), dark, (0.0, 0.0, 0.5)),
        meshes.box((2.0, 2.2, 0.8), paint, (-0.7, 0.0, 0.86)),
        meshes.box((1.3, 0.95, 1.6), paint, (0.55, 0.6, 0.87)),
        meshes.front((0.2, 1.0), (1.3, 2.35), 1.21, glass),
        meshes.polygon(
            [(1.1, 1.086, 1.5), (0.1, 1.086, 1.5), (0.1, 1.086, 2.35), (1.1, 1.086, 2.35)], glass
        ),
        meshes.rod((0.6, -0.2, 1.3), (elbow[0], -0.2, elbow[1]), 0.2, paint, sections=6),
        meshes.rod((elbow[0], -0.2, elbow[1]), (wrist[0], -0.2, wrist[1]), 0.14, paint, sections=6),
        meshes.at(meshes.extrude(bucket, 0.9, dark), wrist[0] - 0.2, -0.2, wrist[1] - 0.85),
    ]
    return meshes.scaled(meshes.join(parts), (scale, scale, scale))


@meshes.thing
def dumper(rng: np.random.Generator) -> Mover:
    """A small tipper with its skip before the driver."""
    paint, tyre, dark = m.MACHINE_PAINT.draw(rng), m.TYRE.draw(rng), m.DARK_METAL.draw(rng)
    skip = [(0.2, 0.85), (1.3, 0.85), (1.75, 1.55), (0.0, 1.55)]
    body = meshes.join(
        [
            # Skip, frame, engine, roll bar, driver.
            meshes.extrude(skip, 1.7, paint),
            meshes.box((2.6, 0.9, 0.35), dark, (0.0, 0.0, 0.5)),
            meshes.box((1.0, 1.2, 0.6), paint, (-1.0, 0.0, 0.86)),
            *(meshes.rod((-1.3, y, 1.4), (-1.3, y, 2.4), 0.04, dark, 5) for y in (-0.5, 0.5)),
            meshes.rod((-1.3, -0.5, 2.4), (-1.3, 0.5, 2.4), 0.04, dark, sections=5),
            people.torso(rng, (-0.75, 0.0, 1.4)),
            people.head(rng, (-0.72, 0.0, 2.25), helmet=True),
        ]
    )
    wheels = (axle(x, 0.85, 0.45, tyre, dark) for x in (0.8, -0.9))
    return Mover((Rigid(body), *wheels))


@meshes.thing
def barrier_board(rng: np.random.Generator) -> Mesh:
    """A board of retro-reflecting and coloured bars between two feet, along y."""
    sheets = m.RETRO_SHEET.draw(rng), m.RETRO_SHEET.draw(rng)
    length, foot, metal = rng.uniform(1.8, 2.6), m.RUBBER.draw(rng), m.METAL.draw(rng)
    bars = np.linspace(-length / 2, length / 2, 8)
    parts = [
        meshes.front((a, b), (z, z + 0.25), 0.03, sheets[i % 2])
        for i, (a, b) in enumerate(pairwise(bars))
        for z in (0.35, 0.75)
    ]
    backs = [
        meshes.back((-length / 2, length / 2), (z, z + 0.25), 0.02, metal) for z in (0.35, 0.75)
    ]
    posts = [meshes.box((0.04, 0.06, 1.05), metal, (0.0, y, 0.0)) for y in (bars[1], bars[-2])]
    feet = [meshes.box((0.8, 0.35, 0.1), foot, (0.0, y, 0.0)) for y in (bars[1], bars[-2])]
    return meshes.join([*parts, *backs, *posts, *feet])


WIRE_MESH = m.Finish((0.30, 0.50), 0.1, 0.3, clear=(0.80, 0.92))
"""A grid of wires too fine to draw: most light goes through."""


@meshes.thing
def site_fence(rng: np.random.Generator) -> Mesh:
    """A panel of wire mesh in a frame of tube, on two feet, along y."""
    tube, wire, foot = m.METAL.draw(rng), WIRE_MESH.draw(rng), m.CONCRETE.draw(rng)
    half, low, top = 1.7, 0.15, 2.0
    panel = meshes.front((-half, half), (low, top), 0.0, wire)
    posts = [meshes.rod((0, y, 0), (0, y, top), 0.022, tube, sections=5) for y in (-half, half)]
    rails = [meshes.rod((0, -half, z), (0, half, z), 0.018, tube, 5) for z in (low, 1.1, top)]
    feet = [meshes.box((0.7, 0.24, 0.14), foot, (0.0, y, 0.0)) for y in (0.2 - half, half - 0.2)]
    return meshes.join([panel, *posts, *rails, *feet])


@meshes.thing
def gravel_heap(rng: np.random.Generator) -> Mesh:
    """A heap of gravel, sand or soil at its angle of repose."""
    finish = (m.GRAVEL, m.SOIL)[rng.integers(2)].draw(rng)
    radius = rng.uniform(0.9, 2.2)
    lumps = [
        meshes.blob(rng, radius * share, finish, (x * radius, y * radius, 0.0))
        for x, y, share in ((0.0, 0.0, 1.0), (0.5, 0.2, 0.6), (-0.3, -0.5, 0.6))
    ]
    return meshes.scaled(meshes.join(lumps), (1.0, 1.0, rng.uniform(0.45, 0.62)))


@meshes.thing
def pipe_stack(rng: np.random.Generator) -> Mesh:
    """Pipes in a pyramid on two beams."""
    finish = (m.CONCRETE, m.PLASTIC, m.DARK_METAL)[rng.integers(3)].draw(rng)
    radius, length, wood = rng.uniform(0.12, 0.3), rng.uniform(2.0, 4.0), m.WOOD.draw(rng)
    rows = [(layer, i) for layer in range(3) for i in range(3 - layer)]
    pipes = [
        meshes.rod((-length / 2, y, z), (length / 2, y, z), radius, finish, sections=10)
        for y, z in (
            (radius * (2 * i - 2 + layer), 0.1 + radius * (1 + 1.75 * layer)) for layer, i in rows
        )
    ]
    beams = [meshes.box((0.1, 6 * radius, 0.1), wood, (x, 0.0, 0.0)) for x in (-0.6, 0.6)]
    stakes = [
        meshes.box((0.08, 0.08, 5 * radius), wood, (x, y, 0.0))
        for x in (-0.6, 0.6)
        for y in (-3.3 * radius - 0.05, 3.3 * radius + 0.05)
    ]
    return meshes.join([*pipes, *beams, *stakes])


@meshes.thing
def block_stack(rng: np.random.Generator) -> Mesh:
    """Bricks or blocks in stepped courses."""
    finish, high = (m.BRICK, m.CONCRETE)[rng.integers(2)].draw(rng), rng.integers(2, 6)
    return meshes.join(
        meshes.box((1.1 - 0.1 * i, 0.95 - 0.05 * i, 0.24), finish, (0.0, 0.0, 0.241 * i))
        for i in range(high)
    )


@meshes.thing
def site_container(rng: np.random.Generator) -> Mesh:
    """An office container of corrugated sheet, with a door and a window; its side faces +x."""
    paint, dark, glass = m.MACHINE_PAINT.draw(rng), m.DARK_METAL.draw(rng), m.GLASS.draw(rng)
    length, half = rng.uniform(3.0, 6.0), 1.2
    ribs = [
        meshes.box((0.05, 0.12, 2.2), paint, (half + 0.026, y, 0.25))
        for y in np.arange(-length / 2 + 0.2, length / 2 - 0.1, 0.5)
    ]
    return meshes.join(
        [
            meshes.box((2 * half, length, 2.5), paint, (0.0, 0.0, 0.1)),
            meshes.box((2 * half + 0.06, length + 0.06, 0.12), dark, (0.0, 0.0, 0.0)),
            *ribs,
            meshes.front((-0.45, 0.45), (0.2, 2.2), half + 0.065, dark),
            meshes.front((0.7, 1.35), (1.1, 1.9), half + 0.07, glass),
        ]
    )


@meshes.thing
def portable_toilet(rng: np.random.Generator) -> Mesh:
    """A toilet cabin of plastic with a bright roof."""
    body, roof = m.PLASTIC.draw(rng), m.WHITE_PAINT.draw(rng)
    top = [(-0.55, 2.1), (0.55, 2.1), (0.3, 2.35), (-0.3, 2.35)]
    return meshes.join(
        [
            meshes.box((1.05, 1.05, 2.1), body),
            meshes.extrude(top, 1.1, roof),
            meshes.front((-0.35, 0.35), (0.15, 1.95), 0.54, m.PLASTIC.draw(rng)),
        ]
    )


@meshes.thing
def light_tower(rng: np.random.Generator, height_m: float, radiance: float) -> Mesh:
    """A mast on a trailer with four flood lights facing +x."""
    metal, lens = m.METAL.draw(rng), m.LENS.draw(rng).glowing(radiance)
    lamps = [
        meshes.front((y, y + 0.3), (height_m + z, height_m + z + 0.2), 0.11, lens)
        for y in (-0.32, 0.02)
        for z in (0.02, 0.26)
    ]
    return meshes.join(
        [
            meshes.box((1.4, 1.0, 0.9), m.MACHINE_PAINT.draw(rng), (-0.3, 0.0, 0.2)),
            meshes.box((1.6, 0.2, 0.2), metal, (-0.3, 0.0, 0.0)),
            meshes.rod((0, 0, 1.1), (0, 0, height_m), 0.06, metal, sections=6),
            meshes.box((0.2, 0.72, 0.5), metal, (0.0, 0.0, height_m)),
            *lamps,
        ]
    )


@meshes.thing
def scaffold(rng: np.random.Generator) -> Mesh:
    """One bay of scaffolding along y: standards, ledgers, a brace and planks on two levels."""
    tube, wood, half = m.METAL.draw(rng), m.WOOD.draw(rng), 1.25
    standards = [
        meshes.rod((x, y, 0), (x, y, 5.0), 0.025, tube, sections=5)
        for x in (-0.4, 0.4)
        for y in (-half, half)
    ]
    ledgers = [
        meshes.rod((x, -half, z), (x, half, z), 0.022, tube, sections=4)
        for x in (-0.4, 0.4)
        for z in (1.0, 2.2, 3.2)
    ]
    planks = [meshes.box((0.75, 2 * half, 0.05), wood, (0.0, 0.0, z)) for z in (2.0, 4.0)]
    brace = meshes.rod((0.4, -half, 0.1), (0.4, half, 2.0), 0.02, tube, sections=4)
    return meshes.join([*standards, *ledgers, *planks, brace])


@meshes.thing
def unfinished_wall(rng: np.random.Generator, length_m: float) -> Mesh:
    """Slabs on columns with openings, as the shell of a building, along y."""
    concrete, half = m.CONCRETE.draw(rng), length_m / 2
    posts = [(x, y) for x in (-0.2, -3.5) for y in (0.2 - half, 0.0, half - 0.2)]
    slabs = [meshes.box((4.0, length_m, 0.25), concrete, (-1.9, 0.0, z)) for z in (2.8, 5.8)]
    columns = [
        meshes.box((0.35, 0.35, 2.8), concrete, (x, y, z)) for x, y in posts for z in (0.0, 3.05)
    ]
    parapet = meshes.box((0.2, length_m, rng.uniform(0.4, 1.1)), m.BRICK.draw(rng), (-0.2, 0, 0))
    return meshes.join([*slabs, *columns, parapet])
