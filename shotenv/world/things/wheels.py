"""Wheels of everything that rolls; upright, turning about y."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.geometry import Material, Mesh, Wheels, meshes


def axle(
    x: float, half: float, radius: float, tyre: Material, rim: Material, width: float = 0.22
) -> Wheels:
    """Two tyres on an axle that look 2 cm out of a body's sides, at `half` of its width."""
    outer = half + 0.02
    parts = []
    for side in (-1, 1):
        # Counter-clockwise seen from outside, on either side. Five corners, as the spokes of many
        # rims: of a round disc nobody could see that it turns.
        turns = np.linspace(0, 2 * np.pi, 5, endpoint=False) * -side
        disc = [
            (0.68 * radius * np.cos(a), side * (outer + 0.008), 0.68 * radius * np.sin(a))
            for a in turns
        ]
        ends = (0.0, side * (outer - width), 0.0), (0.0, side * outer, 0.0)
        parts += [meshes.rod(*ends, radius, tyre, sections=10), meshes.polygon(disc, rim)]
    return Wheels(meshes.join(parts), (x, 0.0, radius), radius)


def hoop(radius: float, material: Material, thickness: float = 0.03) -> Mesh:
    """A ring in the x-z plane about the origin, as the wheel of a bicycle."""
    turns = np.linspace(0, 2 * np.pi, 10)
    rim = [(radius * np.cos(a), 0.0, radius * np.sin(a)) for a in turns]
    return meshes.join(meshes.rod(a, b, thickness, material, sections=3) for a, b in pairwise(rim))


def ring(
    x: float,
    radius: float,
    tyre: Material,
    thickness: float = 0.03,
    y: tuple[float, ...] = (0.0,),
    inside: tuple[Mesh, ...] = (),
) -> Wheels:
    """Thin wheels beside each other on one axle, each with what turns inside its tyre."""
    wheel = meshes.join([hoop(radius, tyre, thickness), *inside])
    mesh = meshes.join(meshes.at(wheel, 0.0, beside) for beside in y)
    # Of rods, tyres have corners that are farther from the axle than its height over the ground.
    height = -float(mesh.corners[..., 2].min())
    return Wheels(mesh, (x, 0.0, height), height)


def spokes(radius: float, metal: Material) -> Mesh:
    """A cross of thin rods: enough to see that a wheel turns."""
    return meshes.join(
        meshes.rod((-dx, 0.0, -dz), (dx, 0.0, dz), 0.008, metal, sections=3)
        for dx, dz in ((radius, 0.0), (0.0, radius))
    )
