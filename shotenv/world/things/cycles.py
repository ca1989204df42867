"""Bicycles, motorcycles and kick scooters with their riders, standing on z = 0 and facing +x."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Mesh, Mover, Part, Rigid, materials as m, meshes
from shotenv.world.things import people
from shotenv.world.things.wheels import axle, ring, spokes


@meshes.thing
def bicycle(rng: np.random.Generator) -> Mesh:
    """A parked bicycle with its reflectors."""
    return Mover(machine(rng)).at_rest


def machine(rng: np.random.Generator) -> tuple[Part, ...]:
    """A bicycle's frame and its wheels, with a retro-reflector between the spokes of each."""
    metal, tyre, glint = m.DARK_METAL.draw(rng), m.TYRE.draw(rng), m.RETRO_SHEET.draw(rng)
    inside = spokes(0.33, metal), meshes.box((0.05, 0.012, 0.04), glint, (0.0, 0.0, 0.2))
    wheels = [ring(x, 0.33, tyre, inside=inside) for x in (-0.5, 0.52)]
    (hub_rear, hub_front), crank = (wheel.hub_m for wheel in wheels), (-0.10, 0.0, 0.30)
    saddle, handle = (-0.2, 0.0, 0.92), (0.38, 0.0, 0.98)
    # The tubes of a diamond frame, the fork, and the handle bar across.
    joints = [(hub_rear, crank), (hub_rear, saddle), (crank, saddle), (crank, handle)]
    joints += [(saddle, handle), (handle, hub_front), ((0.38, -0.25, 1.0), (0.38, 0.25, 1.0))]
    frame = [meshes.rod(a, b, 0.025, metal, sections=4) for a, b in joints]
    rear = meshes.back((-0.04, 0.04), (0.70, 0.76), -0.36, glint)
    front = meshes.front((-0.04, 0.04), (0.82, 0.88), 0.46, glint)
    return Rigid(meshes.join([*frame, rear, front])), *wheels


@meshes.thing
def cyclist(rng: np.random.Generator) -> Mover:
    """A bicycle and the person on it, who pedals."""
    return Mover((*machine(rng), *people.seated_rider(rng)))


@meshes.thing
def motorcycle(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mover:
    """A motorcycle and its rider in a helmet."""
    paint, metal, tyre = m.COLOUR_CAR_PAINT.draw(rng), m.METAL.draw(rng), m.TYRE.draw(rng)
    lamp, glow = m.LENS.draw(rng), (headlight_radiance, tail_radiance)
    tank = [(-0.1, 0.72), (0.42, 0.70), (0.46, 0.88), (0.1, 0.98), (-0.1, 0.85)]
    seat = [(-0.85, 0.78), (-0.1, 0.68), (-0.1, 0.80), (-0.85, 0.92)]
    disc = meshes.rod((0.0, -0.08, 0.0), (0.0, 0.08, 0.0), 0.17, metal, sections=5)
    wheels = [ring(x, 0.26, tyre, thickness=0.06, inside=(disc,)) for x in (-0.68, 0.72)]
    # Engine, tank, seat, fork, handle bar, lamp housing, lamps, plate.
    body = meshes.join(
        [
            meshes.box((0.55, 0.32, 0.42), metal, (0.05, 0.0, 0.24)),
            meshes.extrude(tank, 0.30, paint),
            meshes.extrude(seat, 0.26, m.LEATHER.draw(rng)),
            *(meshes.rod((0.72, y, 0.31), (0.45, y, 1.0), 0.03, metal) for y in (-0.1, 0.1)),
            meshes.rod((0.42, -0.36, 1.02), (0.42, 0.36, 1.02), 0.02, metal, sections=5),
            meshes.box((0.1, 0.22, 0.2), paint, (0.55, 0.0, 0.78)),
            meshes.front((-0.09, 0.09), (0.80, 0.95), 0.612, lamp.glowing(glow[0])),
            meshes.back((-0.09, 0.09), (0.72, 0.80), -0.862, lamp.glowing(glow[1])),
            meshes.back((-0.1, 0.1), (0.50, 0.64), -0.97, m.PLATE_SHEET.draw(rng)),
            people.motorcyclist(rng),
        ]
    )
    return Mover((Rigid(body), *wheels))


@meshes.thing
def kick_scooter(rng: np.random.Generator) -> Mover:
    """Somebody standing on an electric scooter."""
    metal, tyre = m.DARK_METAL.draw(rng), m.TYRE.draw(rng)
    wheels = [axle(x, -0.02, 0.11, tyre, metal, width=0.025) for x in (-0.38, 0.45)]
    body = [
        meshes.box((0.75, 0.16, 0.05), metal, (0.0, 0.0, 0.13)),
        meshes.rod((0.45, 0.0, 0.11), (0.36, 0.0, 1.1), 0.025, metal, sections=5),
        meshes.rod((0.36, -0.24, 1.1), (0.36, 0.24, 1.1), 0.018, metal, sections=4),
        meshes.at(people.adult(rng, reach_m=0.36).at_rest, -0.05, 0.0, 0.18),
    ]
    return Mover((Rigid(meshes.join(body)), *wheels))
