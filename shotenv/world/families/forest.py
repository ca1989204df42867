"""A path through a wood: trunks, logs, boulders, ferns, deer. Held out from training."""

from __future__ import annotations

import numpy as np

from shotenv.world.families.roads import BEHIND_M, REACH_M, build_puddles
from shotenv.world.families.traffic import TRIES, draw_one, put_driver, put_row, put_walkers
from shotenv.world.geometry import Arc, Mesh, Mover, Pose, Site, materials as m, meshes
from shotenv.world.things import animals, cycles, plants


def lay_out_forest_path(site: Site, rng: np.random.Generator) -> None:
    """A winding strip of trodden soil under trees, perhaps blocked by a fallen trunk."""
    half = rng.uniform(0.9, 1.6)
    site.build_ground((m.LEAF_LITTER if rng.random() < 0.6 else m.GRASS).draw(rng))
    build_trodden_strip(site, rng, half)
    build_puddles(site, rng, (-1.5, 1.5))
    if rng.random() < 0.45:
        # The power favours short distances, and most obstacles of the near field are close.
        x = site.travel_m + 1.5 + 7.0 * rng.uniform() ** 1.5
        site.put(fallen_tree(rng), x, rng.uniform(-1.0, 1.0), rng.uniform(1.2, 1.9))
    for part in site.stretches():
        put_walkers(part, rng, (0, 3), (-half + 0.2, half - 0.2), 0.004)
        if rng.random() < 0.3:
            x, speed = part.travel_m + rng.uniform(5.0, 14.0), rng.uniform(2.0, 6.0)
            put_driver(part, cycles.cyclist(rng), Pose((x, 0.4 * half, 0.004), np.pi), speed)
        put_deer(part, rng, half)
    # The further off, the sparser and the coarser: what is behind is mostly hidden.
    for side in (-1, 1):
        edge = side * (half + 0.5)
        put_row(site, rng, undergrowth, edge + 0.2 * side, 1.7, 0.0, share=0.7, spread=0.4)
        put_row(site, rng, thing_beside_path, edge + 1.4 * side, 2.4, 0.0, share=0.7, spread=0.7)
        put_row(site, rng, trunk, edge + 3.6 * side, 2.2, 0.0, share=0.8, spread=1.2)
        put_row(site, rng, trunk, edge + 6.4 * side, 3.2, 0.0, share=0.8, spread=1.3)
        put_row(site, rng, plants.conifer, edge + 10.0 * side, 5.0, 0.0, share=0.6, spread=1.5)


def build_trodden_strip(site: Site, rng: np.random.Generator, half: float) -> None:
    """The path itself: bare soil that swings a little from side to side."""
    soil, x = m.SOIL.draw(rng), np.arange(-BEHIND_M, site.travel_m + REACH_M, 4.0)
    swing = 0.25 * half * np.sin(x / rng.uniform(4.0, 8.0) + rng.uniform(0, 2 * np.pi))
    for i in range(len(x) - 1):
        a, b, left, right = x[i], x[i + 1], swing[i], swing[i + 1]
        ring = [(a, left - half), (b, right - half), (b, right + half), (a, left + half)]
        site.build(meshes.polygon([(*corner, 0.004) for corner in ring], soil))


def put_deer(site: Site, rng: np.random.Generator, half: float) -> None:
    """Perhaps a few deer that stand or run across."""
    for _ in range(rng.integers(0, 3)):
        speed = rng.uniform(0.8, 5.0) if rng.random() < 0.5 else 0.0
        animal, side = deer(rng), rng.choice([-1.0, 1.0])
        for _ in range(TRIES):
            x, away = site.travel_m + rng.uniform(3.0, 16.0), side * rng.uniform(half + 0.8, 7.0)
            yaw = -side * np.pi / 2 + rng.uniform(-0.4, 0.4)
            if site.put_moving(animal, Arc(Pose((x, away, 0.0), yaw), speed)):
                break


def undergrowth(rng: np.random.Generator) -> Mesh:
    """Low plants and stones at the edge of the path."""
    return draw_one(rng, (fern, fern, fern, plants.grass_tuft, boulder, stump))


def thing_beside_path(rng: np.random.Generator) -> Mesh:
    """Something larger between path and trees."""
    return draw_one(rng, (trunk, trunk, boulder, log_pile, fern, root_plate, log))


@meshes.thing
def trunk(rng: np.random.Generator) -> Mesh:
    """A tall stem without low branches, some dead stubs, and a crown high above."""
    bark, leaves = m.BARK.draw(rng), m.FOLIAGE.draw(rng)
    radius, high = rng.uniform(0.08, 0.32), rng.uniform(5.0, 8.0)
    profile = [(1.5 * radius, 0.0), (radius, 0.35), (0.75 * radius, high)]
    turn = rng.uniform(0, 2 * np.pi, 3)
    stubs = [
        meshes.rod((0, 0, z), (0.7 * np.cos(a), 0.7 * np.sin(a), z + 0.15), 0.02, bark, sections=3)
        for a, z in zip(turn, rng.uniform(1.2, 4.0, 3), strict=True)
    ]
    # 20 faces are enough so high up; a wood has many trunks.
    crown = meshes.scaled(meshes.blob(rng, 1.0, leaves, (0.0, 0.0, 0.0), 0), (1.9, 1.9, 1.3))
    return meshes.join([meshes.lathe(profile, bark, sections=7), *stubs,
                        meshes.at(crown, 0.0, 0.0, high)])  # fmt: skip


@meshes.thing
def boulder(rng: np.random.Generator) -> Mesh:
    """A rock half in the ground, perhaps with a smaller one."""
    rock, radius = m.ROCK.draw(rng), rng.uniform(0.25, 0.9)
    stones = [meshes.blob(rng, radius, rock, (0.0, 0.0, 0.0))]
    if rng.random() < 0.5:
        stones.append(meshes.blob(rng, 0.5 * radius, rock, (0.9 * radius, 0.5 * radius, 0.0)))
    return meshes.scaled(meshes.join(stones), (1.0, rng.uniform(0.7, 1.0), rng.uniform(0.5, 0.9)))


@meshes.thing
def log(rng: np.random.Generator) -> Mesh:
    """A length of trunk that lies along y."""
    radius, half = rng.uniform(0.12, 0.28), rng.uniform(0.7, 1.6)
    bark, cut = m.BARK.draw(rng), m.WOOD.draw(rng)
    ends = [
        meshes.rod((0, side * half, radius), (0, side * (half + 0.01), radius), 0.9 * radius, cut)
        for side in (-1, 1)
    ]
    return meshes.join([meshes.rod((0, -half, radius), (0, half, radius), radius, bark), *ends])


@meshes.thing
def log_pile(rng: np.random.Generator) -> Mesh:
    """Logs of one length, stacked between stakes; their cut ends face +y and -y."""
    bark, radius, half = m.BARK.draw(rng), rng.uniform(0.10, 0.17), rng.uniform(0.5, 1.2)
    cut, layers, pitch = m.WOOD.draw(rng), 4, 2 * radius
    parts = []
    for layer in range(layers):
        z = radius + layer * 1.75 * radius
        for i in range(6 - layer):
            x = (i - (5 - layer) / 2) * pitch
            parts.append(meshes.rod((x, -half, z), (x, half, z), radius, bark, sections=6))
            parts.append(meshes.rod((x, half, z), (x, half + 0.01, z), 0.8 * radius, cut, 6))
    return meshes.join(parts)


@meshes.thing
def fern(rng: np.random.Generator) -> Mesh:
    """A rosette of fronds."""
    leaf = m.FOLIAGE.draw(rng)
    low = plants.blades(rng, 14, rng.uniform(0.5, 0.8), rng.uniform(0.35, 0.6), leaf)
    return meshes.join([low, plants.blades(rng, 10, 0.35, rng.uniform(0.6, 0.9), leaf)])


@meshes.thing
def stump(rng: np.random.Generator) -> Mesh:
    """What is left of a felled tree."""
    radius, high = rng.uniform(0.18, 0.4), rng.uniform(0.25, 0.6)
    bark, cut = m.BARK.draw(rng), m.WOOD.draw(rng)
    profile = [(1.35 * radius, 0.0), (1.05 * radius, 0.15), (radius, high)]
    top = [(0.0, high - 0.02), (radius, high)]
    return meshes.join([meshes.lathe(profile, bark), meshes.lathe(top, cut)])


@meshes.thing
def fallen_tree(rng: np.random.Generator) -> Mesh:
    """A stem along x that lies on its broken branches."""
    bark, radius, half = m.BARK.draw(rng), rng.uniform(0.14, 0.3), rng.uniform(2.0, 3.2)
    lift = rng.uniform(0.0, 0.35)
    stem = meshes.rod((-half, 0, radius), (half, 0, radius + lift), radius, bark)
    spots = rng.uniform(-0.8, 0.9, 6) * half
    turns = rng.uniform(0.2, np.pi - 0.2, 6)
    branches = [
        meshes.rod(
            (x, 0, radius),
            (x + 0.4, np.cos(a) * rng.uniform(0.5, 1.0), radius + np.sin(a) * 0.9),
            0.03,
            bark,
            sections=4,
        )
        for x, a in zip(spots, turns, strict=True)
    ]
    return meshes.join([stem, *branches])


@meshes.thing
def root_plate(rng: np.random.Generator) -> Mesh:
    """Roots and soil of a tree that the wind threw, on edge, facing +x."""
    soil, bark = m.SOIL.draw(rng), m.BARK.draw(rng)
    plate = meshes.scaled(meshes.blob(rng, 0.9, soil, (0.0, 0.0, 0.0)), (0.35, 1.0, 1.0))
    roots = [
        meshes.rod((0.1, 0, 0.6), (0.5, 1.1 * np.cos(a), 0.7 + 0.9 * np.sin(a)), 0.04, bark, 4)
        for a in np.linspace(0.1, np.pi - 0.1, 6)
    ]
    stem = meshes.rod((-0.1, 0, 0.55), (-2.5, 0, 0.35), 0.22, bark)
    return meshes.join([meshes.at(plate, 0.0, 0.0, 0.55), *roots, stem])


@meshes.thing
def deer(rng: np.random.Generator) -> Mover:
    """A roe or red deer, with or without antlers."""
    coat, size = m.Finish((0.30, 0.50), 0.2, 0.4).draw(rng), rng.uniform(0.75, 1.15)
    # Trunk, neck, head, ears.
    parts = [
        meshes.rod((-0.5, 0, 0.88), (0.45, 0, 0.92), 0.2, coat, sections=8),
        meshes.rod((0.42, 0, 0.95), (0.72, 0, 1.4), 0.09, coat, sections=6),
        meshes.rod((0.66, 0, 1.42), (1.0, 0, 1.3), 0.075, coat, sections=6),
        *(meshes.rod((0.68, y, 1.45), (0.62, 2 * y, 1.6), 0.03, coat, 4) for y in (-0.06, 0.06)),
    ]
    if rng.random() < 0.4:
        parts += [
            meshes.rod((0.7, y, 1.45), (0.6, 4 * y, 1.9), 0.02, m.BARK.draw(rng), 4)
            for y in (-0.05, 0.05)
        ]
    hips, lengths = ((-0.42, 0.38), (-0.09, 0.09)), (0.41, 0.41, 0.03)
    trunk = meshes.join(parts)
    return Mover((animals.four_legged(rng, trunk, hips, lengths, 0.055, coat, size),))
