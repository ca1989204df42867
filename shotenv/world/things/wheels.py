"""Wheels of everything that rolls; upright, turning about y."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.geometry import Material, Mesh, meshes


def wheel(x: float, side: int, half: float, radius: float, tyre: Material, rim: Material) -> Mesh:
    """A tyre that looks 2 cm out of a body's side, at `half` of its width, and its rim."""
    outer, inner = side * (half + 0.02), side * (half - 0.20)
    # Counter-clockwise seen from outside, on either side.
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False) * -side
    disc = [
        (x + 0.62 * radius * np.cos(a), outer + side * 0.008, radius + 0.62 * radius * np.sin(a))
        for a in turns
    ]
    # A tyre of ten sections need not have a corner at its lowest point, and would float.
    rubber = meshes.rod((x, inner, radius), (x, outer, radius), radius, tyre, sections=10)
    return meshes.join([meshes.grounded(rubber), meshes.polygon(disc, rim)])


def hoop(hub: meshes.Point, radius: float, material: Material, thickness: float = 0.03) -> Mesh:
    """A ring in the x-z plane about its hub, as the wheel of a bicycle."""
    turns = np.linspace(0, 2 * np.pi, 10)
    rim = [(hub[0] + radius * np.cos(a), hub[1], hub[2] + radius * np.sin(a)) for a in turns]
    return meshes.join(meshes.rod(a, b, thickness, material, sections=3) for a, b in pairwise(rim))
