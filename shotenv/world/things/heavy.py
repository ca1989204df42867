"""Lorries and buses, standing on z = 0 and facing +x."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Mesh, Mover, Rigid, Wheels, materials as m, meshes
from shotenv.world.things.wheels import axle


@meshes.thing
def lorry(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mover:
    """A cab before a box body or a tarpaulin, marked with retro-reflecting tape at its rear."""
    length, width, height = rng.uniform(6.0, 8.5), rng.uniform(2.2, 2.45), rng.uniform(2.9, 3.5)
    front, rear = length / 2, -length / 2
    load = (m.WHITE_PAINT, m.METAL, m.CLOTHES, m.PLASTIC)[rng.integers(4)].draw(rng)
    load_length = length - 2.0
    middle = rear + load_length / 2
    radius = rng.uniform(0.40, 0.48)
    # Long ones carry their load on two axles at the rear.
    axles = (front - 0.8, rear + 1.3) if length < 7.0 else (front - 0.8, rear + 1.1, rear + 2.2)
    body = meshes.join(
        [
            meshes.box((load_length, width, height - 1.05), load, (middle, 0.0, 1.05)),
            meshes.box((length - 0.4, 0.8, 0.35), m.DARK_METAL.draw(rng), (0.0, 0.0, 0.65)),
            cab(rng, front, width - 0.1),
            nose_lamps(rng, front + 0.012, width, headlight_radiance),
            lorry_tail(rng, rear, width, height, tail_radiance),
        ]
    )
    return Mover((Rigid(body), *_axles(rng, axles, width / 2, radius)))


def cab(rng: np.random.Generator, front: float, width: float) -> Mesh:
    """A tall driver's cab with a wide wind screen and side windows."""
    paint, glass = m.COLOUR_CAR_PAINT.draw(rng), m.GLASS.draw(rng)
    profile = [
        (front - 1.75, 0.5), (front - 0.1, 0.5), (front, 0.7),
        (front - 0.04, 1.45), (front - 0.25, 2.5), (front - 1.75, 2.55),
    ]  # fmt: skip
    half = width / 2
    pane = [
        (front - 0.05, -half, 1.5), (front - 0.05, half, 1.5),
        (front - 0.24, half, 2.45), (front - 0.24, -half, 2.45),
    ]  # fmt: skip
    side = [(front - 1.1, 1.5), (front - 0.25, 1.5), (front - 0.35, 2.25), (front - 1.1, 2.25)]
    windows = [
        meshes.polygon([(x, -half - 0.01, z) for x, z in side], glass),
        meshes.polygon([(x, half + 0.01, z) for x, z in side[::-1]], glass),
    ]
    screen = meshes.polygon(meshes.inset(pane, 0.08, 0.02), glass)
    return meshes.join([meshes.extrude(profile, width, paint), screen, *windows])


def nose_lamps(rng: np.random.Generator, x: float, width: float, radiance: float) -> Mesh:
    """Head lamps low at the outer edges, a dark grille and a number plate."""
    lamp, half = m.LENS.draw(rng).glowing(radiance), width / 2
    spans = [(-half + 0.12, -half + 0.45), (half - 0.45, half - 0.12)]
    return meshes.join(
        [
            *(meshes.front(y, (0.72, 0.92), x, lamp) for y in spans),
            meshes.front((-0.6, 0.6), (0.95, 1.3), x, m.RUBBER.draw(rng)),
            meshes.front((-0.26, 0.26), (0.75, 0.86), x, m.PLATE_SHEET.draw(rng)),
        ]
    )


def lorry_tail(
    rng: np.random.Generator, rear: float, width: float, height: float, radiance: float
) -> Mesh:
    """Contour tape, under-run bar, tail lamps and number plate."""
    tape, lamp, x = m.RETRO_SHEET.draw(rng), m.LENS.draw(rng).glowing(radiance), rear - 0.012
    half = width / 2 - 0.03
    # Contour marking along all four edges, as on real lorries (UN Regulation 104).
    edges = [((-half, half), (1.1, 1.16)), ((-half, half), (height - 0.1, height - 0.04))]
    edges += [((y, y + 0.06), (1.17, height - 0.11)) for y in (-half, half - 0.06)]
    spans = [(-half, -half + 0.4), (half - 0.4, half)]
    bar = meshes.box((0.1, 2 * half, 0.14), m.DARK_METAL.draw(rng), (rear + 0.1, 0.0, 0.45))
    return meshes.join(
        [
            *(meshes.back(y, z, x, tape) for y, z in edges),
            *(meshes.back(y, (0.78, 0.92), x, lamp) for y in spans),
            bar,
            meshes.back((-0.26, 0.26), (0.72, 0.83), x, m.PLATE_SHEET.draw(rng)),
        ]
    )


def _axles(
    rng: np.random.Generator, x: tuple[float, ...], half: float, radius: float
) -> list[Wheels]:
    tyre, rim = m.TYRE.draw(rng), m.METAL.draw(rng)
    return [axle(along, half - 0.03, radius, tyre, rim) for along in x]


@meshes.thing
def bus(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mover:
    """A town bus: a low body, a band of clear windows between posts, seats inside, a roof."""
    length, width = rng.uniform(8.0, 10.5), rng.uniform(2.35, 2.5)
    front, half, sill, top = length / 2, width / 2, 1.25, 2.75
    paint, roof = m.COLOUR_CAR_PAINT.draw(rng), m.WHITE_PAINT.draw(rng)
    glass, cloth = m.CLEAR_GLASS.draw(rng), m.UPHOLSTERY.draw(rng)
    bays = np.linspace(-front, front, round(length / 1.6) + 1)
    posts = [
        meshes.box((0.1, 0.06, top - sill), paint, (float(np.clip(x, -front + 0.05, front - 0.05)),
                   y, sill))
        for x in bays for y in (-half + 0.03, half - 0.03)
    ]  # fmt: skip
    rows = [
        meshes.box((0.12, 0.8, 0.55), cloth, (x, y, sill - 0.1))
        for x in bays[1:-1] for y in (-0.65, 0.65)
    ]  # fmt: skip
    # Inside the posts, which would cut through them.
    sides = [
        meshes.polygon([(-front, y, sill), (front, y, sill), (front, y, top), (-front, y, top)],
                       glass)
        for y in (0.03 - half, half - 0.03)
    ]  # fmt: skip
    body = meshes.join(
        [
            meshes.box((length, width, sill - 0.3), paint, (0.0, 0.0, 0.3)),
            meshes.box((length, width, 0.3), roof, (0.0, 0.0, top)),
            *posts,
            *rows,
            *sides,
            meshes.front((-half + 0.1, half - 0.1), (sill, top), front, glass),
            meshes.back((-half + 0.1, half - 0.1), (sill, top), -front, glass),
            nose_lamps(rng, front + 0.012, width, headlight_radiance),
            bus_tail(rng, -front - 0.012, half, tail_radiance),
        ]
    )
    return Mover((Rigid(body), *_axles(rng, (-0.28 * length, 0.28 * length), half, 0.46)))


def bus_tail(rng: np.random.Generator, x: float, half: float, radiance: float) -> Mesh:
    """Tail lamps, number plate and the engine's grille."""
    lamp = m.LENS.draw(rng).glowing(radiance)
    spans = [(-half + 0.08, -half + 0.3), (half - 0.3, half - 0.08)]
    return meshes.join(
        [
            *(meshes.back(y, (0.7, 1.0), x, lamp) for y in spans),
            meshes.back((-0.26, 0.26), (0.55, 0.66), x, m.PLATE_SHEET.draw(rng)),
            meshes.back((-0.7, 0.7), (0.75, 1.1), x, m.RUBBER.draw(rng)),
        ]
    )
