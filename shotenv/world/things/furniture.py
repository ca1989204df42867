"""What stands along a road, on z = 0 and facing +x: posts, signs, barriers, boxes, seats."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Mesh, materials as m, meshes

LAMP_HEAD_M = (0.5, 0.22)
"""Length and width of the glowing face of a street lamp."""


@meshes.thing
def pole(rng: np.random.Generator) -> Mesh:
    """A plain mast of wood, metal or concrete."""
    finish = (m.METAL, m.WOOD, m.CONCRETE)[rng.integers(3)]
    radius = rng.uniform(0.04, 0.16)
    return meshes.rod((0, 0, 0), (0, 0, rng.uniform(3.0, 7.0)), radius, finish.draw(rng))


@meshes.thing
def lamp_post(rng: np.random.Generator, height_m: float, radiance: float = 0.0) -> Mesh:
    """A street lamp whose arm reaches 1.5 m along +x; its head glows with `radiance`."""
    metal = m.METAL.draw(rng)
    length, width = LAMP_HEAD_M
    lens = m.LENS.draw(rng).glowing(radiance)
    ring = [
        (1.25, -width / 2),
        (1.25, width / 2),
        (1.25 + length, width / 2),
        (1.25 + length, -width / 2),
    ]
    return meshes.join(
        [
            meshes.rod((0, 0, 0), (0, 0, height_m), 0.08, metal),
            meshes.rod((0, 0, height_m - 0.1), (1.4, 0, height_m + 0.05), 0.04, metal, sections=6),
            meshes.box((length + 0.04, width + 0.04, 0.1), metal, (1.5, 0, height_m)),
            meshes.polygon([(x, y, height_m - 0.01) for x, y in ring], lens),
        ]
    )


@meshes.thing
def sign(rng: np.random.Generator) -> Mesh:
    """A traffic sign on a post: round, triangular, diamond or rectangular, retro-reflecting."""
    metal, sheet, paint = m.METAL.draw(rng), m.RETRO_SHEET.draw(rng), m.DARK_METAL.draw(rng)
    size, z = rng.uniform(0.3, 0.42), rng.uniform(1.9, 2.4)
    sides, turn = ((10, 0.0), (3, np.pi / 2), (4, 0.0), (4, np.pi / 4))[rng.integers(4)]
    outline = regular_polygon(sides, size, turn)
    # Face, symbol and the symbol's inside: share of the size, each 6 mm before what it covers.
    plates = [(1.0, 0.050, sheet), (0.55, 0.056, paint), (0.30, 0.062, sheet)]
    faces = [
        meshes.polygon([(x, share * y, z + share * h) for y, h in outline], material)
        for share, x, material in plates
    ]
    # Turned round, since faces are described from their front; no sign reflects from behind.
    rear = meshes.polygon([(0.045, y, z + h) for y, h in outline[::-1]], metal)
    return meshes.join([meshes.rod((0, 0, 0), (0, 0, z + size), 0.035, metal), rear, *faces])


def regular_polygon(sides: int, radius: float, turn: float) -> list[tuple[float, float]]:
    """Corners of a regular polygon, counter-clockwise, the first at angle `turn`."""
    angles = turn + np.linspace(0, 2 * np.pi, sides, endpoint=False)
    return [(float(radius * np.cos(a)), float(radius * np.sin(a))) for a in angles]


@meshes.thing
def bollard(rng: np.random.Generator) -> Mesh:
    """A short post with a retro-reflecting ring."""
    height, radius = rng.uniform(0.7, 1.05), rng.uniform(0.05, 0.11)
    finish = (m.METAL, m.DARK_METAL, m.CONCRETE, m.WHITE_PAINT)[rng.integers(4)]
    ring = [(1.05 * radius, 0.75 * height), (1.05 * radius, 0.85 * height)]
    return meshes.join(
        [
            meshes.lathe(
                [(radius, 0.0), (radius, height), (0.0, height + 0.03)],
                finish.draw(rng),
                sections=10,
            ),
            meshes.lathe(ring, m.RETRO_SHEET.draw(rng), sections=10),
        ]
    )


@meshes.thing
def cone(rng: np.random.Generator) -> Mesh:
    """A traffic cone."""
    rubber, sheet = m.CLOTHES.draw(rng), m.RETRO_SHEET.draw(rng)
    return meshes.join(
        [
            meshes.box((0.36, 0.36, 0.03), m.RUBBER.draw(rng)),
            meshes.lathe([(0.14, 0.03), (0.03, 0.7), (0.0, 0.7)], rubber, sections=10),
            meshes.lathe([(0.105, 0.3), (0.072, 0.46)], sheet, sections=10),
        ]
    )


@meshes.thing
def crate(rng: np.random.Generator) -> Mesh:
    """A box or a small stack of boxes."""
    finishes = (m.CARDBOARD, m.WOOD, m.METAL, m.DARK_METAL)
    size = rng.uniform(0.35, 0.9, 3)
    lower = meshes.box(tuple(size), finishes[rng.integers(4)].draw(rng))
    upper = meshes.box(tuple(0.7 * size), finishes[rng.integers(4)].draw(rng), (0.03, 0.0, size[2]))
    return meshes.join([lower, upper]) if rng.random() < 0.4 else lower


@meshes.thing
def rubbish_bin(rng: np.random.Generator) -> Mesh:
    """A wheeled rubbish bin with its lid."""
    body, lid = m.DARK_CLOTHES.draw(rng), m.DARK_METAL.draw(rng)
    slope = [(-0.25, 0.0), (0.2, 0.0), (0.32, 0.95), (-0.28, 0.95)]
    cover = meshes.box((0.66, 0.62, 0.06), lid, (0.02, 0.0, 0.951))
    return meshes.join([meshes.extrude(slope, 0.55, body), cover])


@meshes.thing
def guard_rail(rng: np.random.Generator, length_m: float) -> Mesh:
    """A steel beam on posts, along y."""
    metal = m.METAL.draw(rng)
    posts = [
        meshes.box((0.08, 0.12, 0.7), metal, (-0.06, y, 0.0))
        for y in np.arange(-length_m / 2 + 0.5, length_m / 2, 4.0)
    ]
    # The W of a crash barrier, as two beams before a web.
    beams = [meshes.box((0.05, length_m, 0.12), metal, (0.02, 0.0, z)) for z in (0.45, 0.61)]
    return meshes.join(
        [*posts, *beams, meshes.box((0.03, length_m, 0.05), metal, (0.0, 0.0, 0.565))]
    )


@meshes.thing
def jersey_barrier(rng: np.random.Generator, length_m: float) -> Mesh:
    """A concrete barrier with the usual sloped foot, along y."""
    concrete = m.CONCRETE.draw(rng)
    foot = meshes.extrude(
        [(-0.3, 0.0), (0.3, 0.0), (0.12, 0.33), (-0.12, 0.33)], length_m, concrete
    )
    stem = meshes.extrude(
        [(-0.12, 0.33), (0.12, 0.33), (0.07, 0.85), (-0.07, 0.85)], length_m, concrete
    )
    return meshes.join([foot, stem])


@meshes.thing
def fence(rng: np.random.Generator, length_m: float) -> Mesh:
    """Upright boards with gaps on two rails, along y."""
    wood, height = m.WOOD.draw(rng), rng.uniform(0.9, 1.5)
    boards = [
        meshes.box((0.03, 0.14, height), wood, (0.0, y, 0.0))
        for y in np.arange(-length_m / 2 + 0.1, length_m / 2, 0.35)
    ]
    rails = [
        meshes.box((0.05, length_m, 0.08), wood, (-0.045, 0.0, h * height)) for h in (0.25, 0.75)
    ]
    return meshes.join([*boards, *rails])


@meshes.thing
def delineator(rng: np.random.Generator) -> Mesh:
    """A roadside marker post with retro-reflectors on both faces."""
    glint, side = m.RETRO_SHEET.draw(rng), 0.062
    return meshes.join(
        [
            meshes.box((0.12, 0.12, 1.0), m.WHITE_PAINT.draw(rng)),
            meshes.box((0.124, 0.124, 0.25), m.RUBBER.draw(rng), (0.0, 0.0, 0.62)),
            meshes.front((-0.04, 0.04), (0.68, 0.84), side + 0.008, glint),
            meshes.back((-0.04, 0.04), (0.68, 0.84), -side - 0.008, glint),
        ]
    )


@meshes.thing
def chevron_board(rng: np.random.Generator) -> Mesh:
    """A board of retro-reflecting and dark bars at a bend, on two posts."""
    sheet, dark, metal = m.RETRO_SHEET.draw(rng), m.RUBBER.draw(rng), m.METAL.draw(rng)
    bars = [
        meshes.front((y, y + 0.25), (0.9, 1.4), 0.05, sheet if i % 2 else dark)
        for i, y in enumerate(np.arange(-0.75, 0.74, 0.25))
    ]
    posts = [meshes.rod((0, y, 0), (0, y, 1.45), 0.035, metal, sections=6) for y in (-0.5, 0.5)]
    rear = meshes.back((-0.75, 0.75), (0.9, 1.4), 0.04, metal)
    return meshes.join([*bars, *posts, rear])


@meshes.thing
def bench(rng: np.random.Generator) -> Mesh:
    """A seat of planks on two feet, with a back rest."""
    wood, foot = m.WOOD.draw(rng), m.CONCRETE.draw(rng)
    planks = [(x, 0.44) for x in (-0.05, 0.1, 0.25)]
    return meshes.join(
        [
            *(meshes.box((0.12, 1.7, 0.04), wood, (x, 0.0, z)) for x, z in planks),
            *(meshes.box((0.04, 1.7, 0.12), wood, (-0.17, 0.0, z)) for z in (0.58, 0.76)),
            *(meshes.box((0.4, 0.1, 0.44), foot, (0.08, y, 0.0)) for y in (-0.65, 0.65)),
            *(meshes.box((0.06, 0.06, 0.9), foot, (-0.2, y, 0.0)) for y in (-0.65, 0.65)),
        ]
    )


@meshes.thing
def cabinet(rng: np.random.Generator) -> Mesh:
    """A switching cabinet on a plinth, with two doors."""
    height, finish = rng.uniform(0.9, 1.5), (m.PLASTIC, m.METAL, m.CONCRETE)[rng.integers(3)]
    body, gap = finish.draw(rng), m.DARK_METAL.draw(rng)
    return meshes.join(
        [
            meshes.box((0.4, 1.1, 0.12), m.CONCRETE.draw(rng)),
            meshes.box((0.36, 1.06, height), body, (0.0, 0.0, 0.12)),
            meshes.front((-0.01, 0.01), (0.16, height), 0.185, gap),
        ]
    )


@meshes.thing
def letter_box(rng: np.random.Generator) -> Mesh:
    """A letter box on a post."""
    paint = m.COLOUR_CAR_PAINT.draw(rng)
    return meshes.join(
        [
            meshes.rod((0, 0, 0), (0, 0, 0.9), 0.04, m.METAL.draw(rng), sections=6),
            meshes.box((0.3, 0.45, 0.6), paint, (0.0, 0.0, 0.8)),
            meshes.front((-0.15, 0.15), (1.22, 1.26), 0.158, m.RUBBER.draw(rng)),
        ]
    )


@meshes.thing
def planter(rng: np.random.Generator) -> Mesh:
    """A tub of concrete or wood with a bushy plant in it."""
    finish, width = (m.CONCRETE, m.WOOD)[rng.integers(2)].draw(rng), rng.uniform(0.6, 1.1)
    leaves = [
        meshes.blob(rng, rng.uniform(0.2, 0.35), m.FOLIAGE.draw(rng), (x, y, 0.65))
        for x, y in rng.uniform(-0.25, 0.25, (2, 2)) * width
    ]
    return meshes.join([meshes.box((width, width, 0.5), finish), *leaves])
