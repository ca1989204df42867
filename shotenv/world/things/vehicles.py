"""Cars and vans, standing on z = 0 and facing +x; and any vehicle of the traffic."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shotenv.world.geometry import Material, Mesh, Mover, Rigid, Wheels, materials as m, meshes
from shotenv.world.things import cycles, heavy
from shotenv.world.things.wheels import axle

Profile = list[tuple[float, float]]


@dataclass(frozen=True)
class CarShape:
    """Outline of a car in metres: lower body and cabin as (x, z) profiles, counter-clockwise."""

    length: float
    width: float
    body: Profile
    cabin: Profile
    cabin_width: float
    wheel_radius: float


def saloon_shape(rng: np.random.Generator) -> CarShape:
    """A passenger car: from hatchback to estate."""
    length, height = rng.uniform(3.7, 4.8), rng.uniform(1.40, 1.58)
    half, rear_roof = length / 2, rng.uniform(0.28, 0.42)
    body = [
        (-half, 0.38), (-half + 0.12, 0.24), (half - 0.15, 0.24), (half, 0.40),
        (half - 0.03, 0.68), (half - 0.25, 0.80), (0.18 * length, 0.93), (-half + 0.06, 0.95),
    ]  # fmt: skip
    cabin = [
        (-half + 0.08, 0.94), (0.22 * length, 0.91),
        (0.04 * length, height), (-rear_roof * length, height - 0.04),
    ]  # fmt: skip
    width = rng.uniform(1.68, 1.86)
    return CarShape(length, width, body, cabin, 0.86 * width, rng.uniform(0.29, 0.34))


def van_shape(rng: np.random.Generator) -> CarShape:
    """A delivery van or a bus-like people carrier."""
    length, height = rng.uniform(4.6, 5.6), rng.uniform(1.9, 2.4)
    half = length / 2
    body = [
        (-half, 0.42), (-half + 0.08, 0.30), (half - 0.12, 0.30), (half, 0.45),
        (half - 0.03, 0.80), (half - 0.55, 1.10), (-half, 1.12),
    ]  # fmt: skip
    rear = -half + 0.02
    cabin = [(rear, 1.11), (half - 0.56, 1.09), (half - 1.05, height), (rear, height)]
    width = rng.uniform(1.85, 2.0)
    return CarShape(length, width, body, cabin, 0.95 * width, rng.uniform(0.32, 0.36))


def traffic(rng: np.random.Generator, headlight: float = 0.0, tail: float = 0.0) -> Mover:
    """Any motor vehicle of the traffic; its lamps' faces have these radiances, W m-2 sr-1."""
    draw = (car, van, heavy.lorry, heavy.bus, cycles.motorcycle)[
        rng.choice(5, p=(0.64, 0.12, 0.10, 0.06, 0.08))
    ]
    return draw(rng, headlight, tail)


def parked_car(rng: np.random.Generator) -> Mesh:
    """A car or, less often, a van, with its lamps off."""
    return (van(rng) if rng.random() < 0.18 else car(rng)).at_rest


@meshes.thing
def car(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mover:
    """A car with windows to look through, wheels, lamps and retro-reflecting number plates.

    Parameters
    ----------
    rng : Generator
    headlight_radiance, tail_radiance : float
        Radiance of the lamps' faces, W m-2 sr-1; 0 is off.
    """
    shape, paint = saloon_shape(rng), car_paint(rng)
    # Glass to look through, with seats behind it: two surfaces in one pixel, as on real roads.
    glass = (m.CLEAR_GLASS if rng.random() < 0.7 else m.TINTED_GLASS).draw(rng)
    inside = [hollow_cabin(shape, paint, glass), seats(rng, shape)]
    body = [*inside, chassis(rng, shape, paint, headlight_radiance, tail_radiance)]
    return Mover((Rigid(meshes.join(body)), *wheels(rng, shape)))


@meshes.thing
def van(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mover:
    """A delivery van, mostly without windows behind the front seats; parameters as of `car`."""
    shape, paint = van_shape(rng), car_paint(rng)
    cargo = meshes.extrude(shape.cabin, shape.cabin_width, paint)
    panes = meshes.join(
        # Opaque panes a little off the sheet metal: what is behind them is not built.
        meshes.polygon(meshes.inset(outline, 0.16, 0.01), m.GLASS.draw(rng))
        for outline in outlines(shape, rear_share=0.66)[: 2 if rng.random() < 0.6 else 6]
    )
    body = [cargo, panes, chassis(rng, shape, paint, headlight_radiance, tail_radiance)]
    return Mover((Rigid(meshes.join(body)), *wheels(rng, shape)))


def chassis(
    rng: np.random.Generator, shape: CarShape, paint: Material, headlight: float, tail: float
) -> Mesh:
    """Lower body, lamps and plates."""
    return meshes.join(
        [
            meshes.extrude(shape.body, shape.width, paint),
            front_trim(rng, shape, headlight),
            rear_trim(rng, shape, tail),
        ]
    )


def car_paint(rng: np.random.Generator) -> Material:
    """Black, coloured or white paint."""
    kinds = (m.BLACK_CAR_PAINT, m.COLOUR_CAR_PAINT, m.WHITE_CAR_PAINT)
    return kinds[rng.choice(3, p=(0.3, 0.45, 0.25))].draw(rng)


def outlines(shape: CarShape, rear_share: float = 0.5) -> list[list[meshes.Point]]:
    """Where the cabin has windows: wind screen, rear window, front and rear panes of each side."""
    rear, nose, front_roof, rear_roof = shape.cabin
    half = shape.cabin_width / 2
    # The post between front and rear panes stands at this share of the way from the rear.
    low, high = _between(rear, nose, rear_share), _between(rear_roof, front_roof, rear_share)
    sides = [(low, nose, front_roof, high), (rear, low, high, rear_roof)]
    right = [[(x, -half, z) for x, z in side] for side in sides]
    left = [[(x, half, z) for x, z in side[::-1]] for side in sides]
    # Corners counter-clockwise seen from outside, hence the turned order on the left.
    across = [_screen(nose, front_roof, half), _screen(rear_roof, rear, half)]
    return [across[0], right[0], left[0], across[1], right[1], left[1]]


def hollow_cabin(shape: CarShape, paint: Material, glass: Material) -> Mesh:
    """Roof and window frames, with panes in them."""
    _, _, front_roof, rear_roof = shape.cabin
    parts = [meshes.polygon(_screen(front_roof, rear_roof, shape.cabin_width / 2), paint)]
    for outline in outlines(shape):
        pane = meshes.inset(outline, 0.16, 0.0)
        parts += [meshes.frame(outline, pane, paint), meshes.polygon(pane, glass)]
    return meshes.join(parts)


def seats(rng: np.random.Generator, shape: CarShape) -> Mesh:
    """Dashboard, two seat backs and a rear bench."""
    cloth, (roof_x, roof_z) = m.UPHOLSTERY.draw(rng), shape.cabin[2]
    low, width = 0.90, shape.cabin_width
    high = roof_z - low - 0.14
    backs = [
        meshes.box((0.14, 0.45, high), cloth, (roof_x - 0.35, y, low))
        for y in (-width / 4, width / 4)
    ]
    bench = meshes.box((0.16, 0.8 * width, 0.8 * high), cloth, (roof_x - 1.15, 0.0, low))
    dash = meshes.box((0.3, 0.8 * width, 0.12), cloth, (roof_x + 0.45, 0.0, low))
    return meshes.join([*backs, bench, dash])


def _screen(low: tuple[float, float], high: tuple[float, float], half: float) -> list[meshes.Point]:
    """Rectangle across the car between two profile points, seen from outside."""
    return [
        (low[0], -half, low[1]), (low[0], half, low[1]),
        (high[0], half, high[1]), (high[0], -half, high[1]),
    ]  # fmt: skip


def _between(a: tuple[float, float], b: tuple[float, float], share: float) -> tuple[float, float]:
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])


def wheels(rng: np.random.Generator, shape: CarShape) -> list[Wheels]:
    """Two axles of tyres with bright rims."""
    tyre, rim = m.TYRE.draw(rng), m.METAL.draw(rng)
    # A wheelbase of 58 % of the length is usual.
    return [
        axle(x, shape.width / 2, shape.wheel_radius, tyre, rim)
        for x in (-0.29 * shape.length, 0.29 * shape.length)
    ]


def front_trim(rng: np.random.Generator, shape: CarShape, radiance: float) -> Mesh:
    """Head lamps, grille and number plate, a little before the body so that they are seen."""
    x, half = shape.length / 2 + 0.012, shape.width / 2
    lamp = m.LENS.draw(rng).glowing(radiance)
    high = shape.body[4][1]  # The bonnet's front edge, under which the lamps are.
    spans = [(-half + 0.06, -half + 0.42), (half - 0.42, half - 0.06)]
    lamps = [meshes.front(y, (high - 0.16, high - 0.02), x, lamp) for y in spans]
    grille = meshes.front(
        (-half + 0.5, half - 0.5), (high - 0.15, high - 0.03), x, m.RUBBER.draw(rng)
    )
    plate = meshes.front((-0.26, 0.26), (0.40, 0.51), x, m.PLATE_SHEET.draw(rng))
    return meshes.join([*lamps, grille, plate])


def rear_trim(rng: np.random.Generator, shape: CarShape, radiance: float) -> Mesh:
    """Tail lamps, bumper and number plate."""
    x, half = -shape.length / 2 - 0.012, shape.width / 2
    lamp = m.LENS.draw(rng).glowing(radiance)
    spans = [(-half + 0.05, -half + 0.30), (half - 0.30, half - 0.05)]
    lamps = [meshes.back(y, (0.68, 0.84), x, lamp) for y in spans]
    bumper = meshes.back((-half + 0.04, half - 0.04), (0.40, 0.52), x, m.RUBBER.draw(rng))
    plate = meshes.back((-0.26, 0.26), (0.62, 0.73), x, m.PLATE_SHEET.draw(rng))
    return meshes.join([*lamps, bumper, plate])
