"""Things of glass along a street: bus shelters, shop fronts, railings. They face +x."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.geometry import Material, Mesh, materials as m, meshes
from shotenv.world.things import furniture


def upright_pane(
    a: tuple[float, float], b: tuple[float, float], z: tuple[float, float], glass: Material
) -> Mesh:
    """A pane over the line from a to b, (x, y) points."""
    return meshes.polygon([(*a, z[0]), (*b, z[0]), (*b, z[1]), (*a, z[1])], glass)


@meshes.thing
def bus_shelter(rng: np.random.Generator, radiance: float = 0.0) -> Mesh:
    """A roof on posts with panes behind and beside a bench; its poster can glow."""
    length, depth, high = rng.uniform(3.0, 4.2), 1.4, 2.35
    half, metal, glass = length / 2, m.DARK_METAL.draw(rng), m.CLEAR_GLASS.draw(rng)
    posts = [
        meshes.box((0.07, 0.07, high), metal, (x, y, 0.0))
        for x in (-depth / 2, depth / 2 - 0.3)
        for y in (-half, half)
    ]
    # Three panes behind, with gaps between them, and one at the side that has no poster.
    rear = np.linspace(-half + 0.05, half - 0.05, 4)
    panes = [
        upright_pane((-depth / 2, y + 0.03), (-depth / 2, z - 0.03), (0.25, 2.1), glass)
        for y, z in pairwise(rear)
    ]
    side = upright_pane((-depth / 2 + 0.05, half), (0.3, half), (0.25, 2.1), glass)
    poster = meshes.box((1.1, 0.14, 1.8), m.PLASTIC.draw(rng).glowing(radiance), (0.0, -half, 0.25))
    return meshes.join(
        [
            *posts,
            *panes,
            side,
            poster,
            meshes.box((depth + 0.3, length + 0.2, 0.12), metal, (0.05, 0.0, high)),
            meshes.box((0.4, 0.6 * length, 0.06), m.WOOD.draw(rng), (-0.4, 0.0, 0.45)),
            meshes.box((0.1, 0.5 * length, 0.45), metal, (-0.4, 0.0, 0.0)),
        ]
    )


@meshes.thing
def shop_front(rng: np.random.Generator, length_m: float, radiance: float = 0.0) -> Mesh:
    """The street side of a shop: panes before a room with goods, upper floors above it.

    Parameters
    ----------
    rng : Generator
    length_m : float
        Along y.
    radiance : float
        Of the shop's glowing ceiling, W m-2 sr-1; 0 is off.
    """
    height, half, room = rng.uniform(6.0, 9.0), length_m / 2, rng.uniform(1.8, 3.0)
    body, frame, glass = m.PLASTER.draw(rng), m.DARK_METAL.draw(rng), m.CLEAR_GLASS.draw(rng)
    inside, floor = m.PLASTER.draw(rng), m.COATED_FLOOR.draw(rng)
    posts = np.linspace(-half + 0.1, half - 0.1, max(3, round(length_m / 2.2) + 1))
    # Upper floors, lintel, plinth, the room's rear wall, floor, glowing ceiling, side walls, posts,
    # panes, goods.
    parts = [
        meshes.box((4.0, length_m, height - 3.0), body, (-2.0, 0.0, 3.0)),
        meshes.box((0.2, length_m, 0.3), frame, (-0.1, 0.0, 2.7)),
        meshes.box((0.2, length_m, 0.35), body, (-0.1, 0.0, 0.0)),
        meshes.front((-half, half), (0.0, 3.0), -room, inside),
        meshes.patch((-room, -0.2), (-half, half), 0.30, floor),
        meshes.patch((-room, -0.2), (-half, half), 2.69, inside.glowing(radiance)),
        *(
            meshes.box((room, 0.2, 3.0), body, (-room / 2, y, 0.0))
            for y in (0.1 - half, half - 0.1)
        ),
        *(meshes.box((0.1, 0.08, 2.35), frame, (-0.1, y, 0.35)) for y in posts),
        *(
            upright_pane((-0.1, a + 0.04), (-0.1, b - 0.04), (0.35, 2.7), glass)
            for a, b in pairwise(posts)
        ),
        *(goods(rng, (-rng.uniform(0.5, room - 0.4), y, 0.30)) for y in posts[:-1] + 0.9),
    ]
    # Upstairs panes are dark and opaque: nobody looks in from the street, and panes cost rays.
    upper = [meshes.front((y - 0.5, y + 0.5), (3.9, 5.2), 0.012, m.GLASS.draw(rng)) for y in posts]
    return meshes.join([*parts, *upper[1:-1]])


def goods(rng: np.random.Generator, base: meshes.Point) -> Mesh:
    """A stand, a stack or a dummy in a shop window."""
    width, height = rng.uniform(0.4, 0.9), rng.uniform(0.4, 1.7)
    finish = (m.WOOD, m.CLOTHES, m.PLASTIC, m.CARDBOARD)[rng.integers(4)]
    return meshes.box((width, width, height), finish.draw(rng), base)


@meshes.thing
def glass_railing(rng: np.random.Generator, length_m: float) -> Mesh:
    """Panes between posts under a hand rail, along y."""
    metal, glass = m.METAL.draw(rng), m.CLEAR_GLASS.draw(rng)
    posts = np.linspace(-length_m / 2, length_m / 2, max(2, round(length_m / 1.4) + 1))
    return meshes.join(
        [
            *(meshes.box((0.05, 0.05, 1.0), metal, (0.0, y, 0.0)) for y in posts),
            *(
                upright_pane((0.0, a + 0.04), (0.0, b - 0.04), (0.12, 0.92), glass)
                for a, b in pairwise(posts)
            ),
            meshes.box((0.06, length_m, 0.05), metal, (0.0, 0.0, 1.0)),
        ]
    )


@meshes.thing
def cycle_stand(rng: np.random.Generator) -> Mesh:
    """Two hoops of tube to lock bicycles to."""
    metal = m.METAL.draw(rng)
    corners = [(-0.35, 0.0), (-0.35, 0.8), (0.35, 0.8), (0.35, 0.0)]
    rods = [
        meshes.rod((a[0], y, a[1]), (b[0], y, b[1]), 0.025, metal, sections=5)
        for y in (-0.4, 0.4)
        for a, b in pairwise(corners)
    ]
    return meshes.join(rods)


def pavement_glass(rng: np.random.Generator) -> Mesh:
    """Something of glass, or a bench, from a town's pavement."""
    draw = (bus_shelter, furniture.bench, cycle_stand)[rng.integers(3)]
    return draw(rng)
