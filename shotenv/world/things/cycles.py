"""Bicycles, motorcycles and kick scooters with their riders, standing on z = 0 and facing +x."""

from __future__ import annotations

import numpy as np

from shotenv.world.geometry import Mesh, materials as m, meshes
from shotenv.world.things import people
from shotenv.world.things.wheels import hoop


@meshes.thing
def bicycle(rng: np.random.Generator) -> Mesh:
    """A parked bicycle with its reflectors."""
    metal, tyre, glint = m.DARK_METAL.draw(rng), m.TYRE.draw(rng), m.RETRO_SHEET.draw(rng)
    hub_rear, hub_front, crank = (-0.5, 0.0, 0.35), (0.52, 0.0, 0.35), (-0.05, 0.0, 0.30)
    saddle, handle = (-0.2, 0.0, 0.92), (0.38, 0.0, 0.98)
    # The tubes of a diamond frame, the fork, and the handle bar across.
    joints = [(hub_rear, crank), (hub_rear, saddle), (crank, saddle), (crank, handle)]
    joints += [(saddle, handle), (handle, hub_front), ((0.38, -0.25, 1.0), (0.38, 0.25, 1.0))]
    frame = [meshes.rod(a, b, 0.025, metal, sections=4) for a, b in joints]
    hoops = [hoop(hub, 0.34, tyre) for hub in (hub_rear, hub_front)]
    rear = meshes.back((-0.04, 0.04), (0.70, 0.76), -0.36, glint)
    front = meshes.front((-0.04, 0.04), (0.82, 0.88), 0.46, glint)
    return meshes.grounded(meshes.join([*frame, *hoops, rear, front]))


@meshes.thing
def cyclist(rng: np.random.Generator) -> Mesh:
    """A bicycle and the person on it, at any turn of the pedals."""
    bike = bicycle(rng)
    return meshes.join([bike, people.seated_rider(rng, turn_rad=rng.uniform(0, 2 * np.pi))])


@meshes.thing
def motorcycle(
    rng: np.random.Generator, headlight_radiance: float = 0.0, tail_radiance: float = 0.0
) -> Mesh:
    """A motorcycle and its rider in a helmet."""
    paint, metal, tyre = m.COLOUR_CAR_PAINT.draw(rng), m.METAL.draw(rng), m.TYRE.draw(rng)
    hubs = ((-0.68, 0.0, 0.31), (0.72, 0.0, 0.31))
    lamp, glow = m.LENS.draw(rng), (headlight_radiance, tail_radiance)
    tank = [(-0.1, 0.72), (0.42, 0.70), (0.46, 0.88), (0.1, 0.98), (-0.1, 0.85)]
    seat = [(-0.85, 0.78), (-0.1, 0.68), (-0.1, 0.80), (-0.85, 0.92)]
    # Wheels and their discs, engine, tank, seat, fork, handle bar, lamp housing, lamps, plate.
    machine = meshes.join(
        [
            *(hoop(hub, 0.26, tyre, thickness=0.06) for hub in hubs),
            *(meshes.rod((x, -0.08, 0.31), (x, 0.08, 0.31), 0.17, metal) for x, _, _ in hubs),
            meshes.box((0.55, 0.32, 0.42), metal, (0.05, 0.0, 0.24)),
            meshes.extrude(tank, 0.30, paint),
            meshes.extrude(seat, 0.26, m.LEATHER.draw(rng)),
            *(meshes.rod((0.72, y, 0.31), (0.45, y, 1.0), 0.03, metal) for y in (-0.1, 0.1)),
            meshes.rod((0.42, -0.36, 1.02), (0.42, 0.36, 1.02), 0.02, metal, sections=5),
            meshes.box((0.1, 0.22, 0.2), paint, (0.55, 0.0, 0.78)),
            meshes.front((-0.09, 0.09), (0.80, 0.95), 0.612, lamp.glowing(glow[0])),
            meshes.back((-0.09, 0.09), (0.72, 0.80), -0.862, lamp.glowing(glow[1])),
            meshes.back((-0.1, 0.1), (0.50, 0.64), -0.97, m.PLATE_SHEET.draw(rng)),
        ]
    )
    return meshes.grounded(meshes.join([machine, people.motorcyclist(rng)]))


@meshes.thing
def kick_scooter(rng: np.random.Generator) -> Mesh:
    """Somebody standing on an electric scooter."""
    metal, tyre = m.DARK_METAL.draw(rng), m.TYRE.draw(rng)
    wheels = [
        meshes.rod((x, -0.025, 0.11), (x, 0.025, 0.11), 0.11, tyre, sections=8)
        for x in (-0.38, 0.45)
    ]
    parts = [
        *wheels,
        meshes.box((0.75, 0.16, 0.05), metal, (0.0, 0.0, 0.13)),
        meshes.rod((0.45, 0.0, 0.11), (0.36, 0.0, 1.1), 0.025, metal, sections=5),
        meshes.rod((0.36, -0.24, 1.1), (0.36, 0.24, 1.1), 0.018, metal, sections=4),
        meshes.at(people.adult(rng, stride_m=0.3, reach_m=0.36), 0.0, 0.0, 0.18),
    ]
    return meshes.grounded(meshes.join(parts))
