"""Trees, bushes and grasses, on z = 0."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Material, Mesh, materials as m, meshes


def tree(rng: np.random.Generator) -> Mesh:
    """A tree of any shape."""
    draw = (broadleaf, conifer, poplar, sapling)[rng.choice(4, p=(0.5, 0.2, 0.15, 0.15))]
    return draw(rng)


def shrub(rng: np.random.Generator) -> Mesh:
    """A low plant of any shape."""
    return (bush, grass_tuft, reeds)[rng.choice(3, p=(0.5, 0.3, 0.2))](rng)


@meshes.thing
def broadleaf(rng: np.random.Generator) -> Mesh:
    """Trunk with two branches under a crown of irregular lumps."""
    bark, leaves = m.BARK.draw(rng), m.FOLIAGE.draw(rng)
    stem, radius, spread = rng.uniform(1.5, 2.8), rng.uniform(0.1, 0.28), rng.uniform(0.8, 1.6)
    trunk = meshes.lathe([(1.4 * radius, 0.0), (radius, 0.3), (0.7 * radius, stem + 0.6)], bark)
    branches = [
        meshes.rod((0, 0, stem - 0.3), (spread * np.cos(a) / 2, spread * np.sin(a) / 2, stem + 0.7),
                   0.4 * radius, bark, sections=5)
        for a in rng.uniform(0, 2 * np.pi, 2)
    ]  # fmt: skip
    lumps = [
        meshes.blob(rng, rng.uniform(0.6, 1.0) * spread, leaves, (x, y, stem + spread * (0.6 + h)))
        for x, y, h in zip(
            *rng.uniform(-0.7, 0.7, (2, 4)) * spread, rng.uniform(0, 1.1, 4), strict=True
        )
    ]
    return meshes.join([trunk, *branches, *lumps])


@meshes.thing
def conifer(rng: np.random.Generator) -> Mesh:
    """A stem under stacked cones."""
    bark, needles = m.BARK.draw(rng), m.FOLIAGE.draw(rng)
    height, width = rng.uniform(3.5, 7.0), rng.uniform(0.9, 1.6)
    levels = np.linspace(0.15, 0.7, 4)  # Where tiers of branches start, as shares of the height.
    cones = [
        meshes.lathe(
            [(0, z * height), (width * (1 - z), z * height), (0, (z + 0.3) * height)], needles
        )
        for z in levels
    ]
    return meshes.join([meshes.rod((0, 0, 0), (0, 0, 0.5 * height), 0.12, bark), *cones])


@meshes.thing
def bush(rng: np.random.Generator) -> Mesh:
    """A few leafy lumps that reach the ground."""
    leaves = m.FOLIAGE.draw(rng)
    radius = rng.uniform(0.3, 0.6)
    centres = rng.uniform(-1, 1, (3, 2)) * radius
    return meshes.join(
        meshes.blob(rng, radius * rng.uniform(0.7, 1.1), leaves, (x, y, 0.35 * radius))
        for x, y in centres
    )


@meshes.thing
def hedge(rng: np.random.Generator, length_m: float) -> Mesh:
    """A clipped hedge along y: overlapping lumps around a box."""
    leaves, height = m.FOLIAGE.draw(rng), rng.uniform(0.8, 1.6)
    lumps = [
        meshes.blob(rng, 0.45, leaves, (0.1, y, height * h), detail=1)
        for y, h in zip(
            # 99 draws whatever the length, more than any hedge has lumps.
            np.arange(-length_m / 2, length_m / 2, 0.8),
            rng.uniform(0.3, 0.8, 99),
            strict=False,
        )
    ]
    return meshes.join([meshes.box((0.7, length_m, height), leaves), *lumps])


@meshes.thing
def poplar(rng: np.random.Generator) -> Mesh:
    """A slender crown that starts low."""
    leaves, width, low = m.FOLIAGE.draw(rng), rng.uniform(0.5, 0.9), rng.uniform(0.4, 1.2)
    lumps = [
        meshes.blob(rng, width * share, leaves, (*rng.uniform(-0.1, 0.1, 2), low + width + z))
        for z, share in ((0.0, 0.9), (0.9, 1.0), (1.9, 0.9), (2.9, 0.65), (3.6, 0.4))
    ]
    trunk = meshes.rod((0, 0, 0), (0, 0, low + 1.0), 0.12, m.BARK.draw(rng), sections=6)
    return meshes.join([trunk, *lumps])


@meshes.thing
def sapling(rng: np.random.Generator) -> Mesh:
    """A young tree tied to two stakes."""
    height, stake = rng.uniform(2.0, 3.2), m.WOOD.draw(rng)
    crown = [
        meshes.blob(rng, rng.uniform(0.25, 0.45), m.FOLIAGE.draw(rng), (x, y, height + h))
        for x, y, h in rng.uniform(-0.25, 0.25, (3, 3))
    ]
    return meshes.join(
        [
            meshes.rod((0, 0, 0), (0, 0, height), 0.035, m.BARK.draw(rng), sections=5),
            *(meshes.rod((0, y, 0), (0, y, 1.5), 0.03, stake, sections=5) for y in (-0.3, 0.3)),
            meshes.box((0.02, 0.6, 0.06), stake, (0.035, 0.0, 1.3)),
            *crown,
        ]
    )


def blades(
    rng: np.random.Generator, count: int, spread_m: float, height_m: float, leaf: Material
) -> Mesh:
    """Upright pointed blades that bend outwards from the middle."""
    turn = rng.uniform(0, 2 * np.pi, count)
    outwards = spread_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    foot = rng.uniform(0.0, 0.6, (count, 1)) * outwards
    tip = foot + rng.uniform(0.3, 1.0, (count, 1)) * outwards
    side = 0.12 * outwards[:, ::-1] * np.array([-1.0, 1.0])
    # One triangle each: leaves by the thousand would use up the budget of triangles.
    corners = np.zeros((count, 3, 3))
    corners[..., :2] = np.stack([foot - side, foot + side, tip], axis=1)
    corners[:, 2, 2] = height_m * rng.uniform(0.6, 1.0, count)
    return meshes.soup(corners, leaf)


@meshes.thing
def grass_tuft(rng: np.random.Generator) -> Mesh:
    """Tall grass or weeds in a bunch."""
    return blades(rng, 24, rng.uniform(0.2, 0.4), rng.uniform(0.3, 0.8), m.GRASS.draw(rng))


@meshes.thing
def reeds(rng: np.random.Generator) -> Mesh:
    """Reeds or canes, high and thin, in a clump."""
    leaf = m.FOLIAGE.draw(rng)
    spots = rng.uniform(-0.4, 0.4, (5, 2))
    clumps = [blades(rng, 8, 0.25, rng.uniform(0.9, 1.6), leaf) for _ in spots]
    return meshes.join(meshes.at(c, x, y) for c, (x, y) in zip(clumps, spots, strict=True))
