"""Things on wheels, standing on z = 0 and facing +x."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from shotenv.world import materials as m
from shotenv.world import meshes
from shotenv.world.materials import Material
from shotenv.world.model import Mesh
from shotenv.world.people import seated_rider

Profile = list[tuple[float, float]]


@dataclass(frozen=True)
class CarShape:
    """Outline of a car in metres: lower body and cabin as (x, z) profiles."""

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


def car(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mesh:
    """A car or van with windows, wheels, lamps and retro-reflecting number plates.

    Parameters
    ----------
    rng : Generator
    headlight_radiance, tail_radiance : float
        Radiance of the lamps' faces, W m-2 sr-1; 0 is off.
    """
    shape = van_shape(rng) if rng.random() < 0.2 else saloon_shape(rng)
    paint = car_paint(rng)
    return meshes.join(
        [
            meshes.extrude(shape.body, shape.width, paint),
            meshes.extrude(shape.cabin, shape.cabin_width, paint),
            windows(rng, shape),
            wheels(rng, shape),
            front_trim(rng, shape, headlight_radiance),
            rear_trim(rng, shape, tail_radiance),
        ]
    )


def car_paint(rng: np.random.Generator) -> Material:
    """Black, coloured or white paint."""
    kinds = (m.BLACK_CAR_PAINT, m.COLOUR_CAR_PAINT, m.WHITE_CAR_PAINT)
    return kinds[rng.choice(3, p=(0.3, 0.45, 0.25))].draw(rng)


def windows(rng: np.random.Generator, shape: CarShape) -> Mesh:
    """Wind screen, rear window and two panes on each side, a centimetre off the cabin."""
    glass = m.GLASS.draw(rng)
    rear, nose, front_roof, rear_roof = shape.cabin
    half = shape.cabin_width / 2
    screens = [_pane(nose, front_roof, half), _pane(rear_roof, rear, half)]
    middle_low, middle_high = _between(rear, nose), _between(rear_roof, front_roof)
    outlines = [
        (middle_low, nose, front_roof, middle_high),
        (rear, middle_low, middle_high, rear_roof),
    ]
    right = [[(x, -half, z) for x, z in outline] for outline in outlines]
    left = [[(x, half, z) for x, z in outline[::-1]] for outline in outlines]
    panes = [*screens, *right, *left]
    return meshes.join(meshes.polygon(meshes.inset(pane, 0.16, 0.01), glass) for pane in panes)


def _pane(low: tuple[float, float], high: tuple[float, float], half: float) -> list[meshes.Point]:
    """Rectangle across the car between two profile points, seen from outside."""
    return [
        (low[0], -half, low[1]), (low[0], half, low[1]),
        (high[0], half, high[1]), (high[0], -half, high[1]),
    ]  # fmt: skip


def _between(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return (a[0] + b[0]) / 2, (a[1] + b[1]) / 2


def wheels(rng: np.random.Generator, shape: CarShape) -> Mesh:
    """Four tyres with bright rims."""
    tyre, rim = m.TYRE.draw(rng), m.METAL.draw(rng)
    radius, axle = shape.wheel_radius, 0.29 * shape.length
    return meshes.join(
        wheel(x, side, shape.width / 2, radius, tyre, rim)
        for x in (-axle, axle)
        for side in (-1, 1)
    )


def wheel(x: float, side: int, half: float, radius: float, tyre: Material, rim: Material) -> Mesh:
    """A tyre that looks out of the body by 2 cm, and its rim."""
    outer, inner = side * (half + 0.02), side * (half - 0.20)
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False) * -side
    disc = [
        (x + 0.62 * radius * np.cos(a), outer + side * 0.008, radius + 0.62 * radius * np.sin(a))
        for a in turns
    ]
    rubber = meshes.rod((x, inner, radius), (x, outer, radius), radius, tyre, sections=12)
    return meshes.join([rubber, meshes.polygon(disc, rim)])


def front_trim(rng: np.random.Generator, shape: CarShape, radiance: float) -> Mesh:
    """Head lamps, grille and number plate."""
    x, half = shape.length / 2 + 0.012, shape.width / 2
    lamp = m.LENS.draw(rng).glowing(radiance)
    high = shape.body[4][1]
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


def cyclist(rng: np.random.Generator) -> Mesh:
    """A bicycle and the person on it."""
    metal, tyre = m.DARK_METAL.draw(rng), m.TYRE.draw(rng)
    hub_rear, hub_front, crank = (-0.5, 0.0, 0.35), (0.52, 0.0, 0.35), (-0.05, 0.0, 0.30)
    saddle, handle = (-0.2, 0.0, 0.92), (0.38, 0.0, 0.98)
    joints = [(hub_rear, crank), (hub_rear, saddle), (crank, saddle), (crank, handle)]
    joints += [(saddle, handle), (handle, hub_front), ((0.38, -0.25, 1.0), (0.38, 0.25, 1.0))]
    frame = [meshes.rod(a, b, 0.025, metal, sections=4) for a, b in joints]
    hoops = [hoop(hub, 0.34, tyre) for hub in (hub_rear, hub_front)]
    return meshes.join([*frame, *hoops, seated_rider(rng)])


def hoop(hub: meshes.Point, radius: float, material: Material) -> Mesh:
    """A bicycle wheel: an upright ring in the x-z plane about its hub."""
    turns = np.linspace(0, 2 * np.pi, 10)
    rim = [(hub[0] + radius * np.cos(a), hub[1], hub[2] + radius * np.sin(a)) for a in turns]
    return meshes.join(meshes.rod(a, b, 0.03, material, sections=3) for a, b in pairwise(rim))
