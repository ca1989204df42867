"""Walls, facades, pillars and tubes. Facades face +x with their foot on z = 0 at x = 0."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from shotenv.world.geometry import Material, Mesh, lights, materials as m, meshes

ROOM_LIGHTING = lights.Lighting(
    (5.0, 50.0), {"led": 0.7, "fluorescent": 0.1, "halogen": 0.1, "incandescent": 0.1}
)
"""Luminance of a lit window, cd m-2; all assumed."""


def wall_material(rng: np.random.Generator) -> Material:
    """Plaster, brick or concrete."""
    return (m.PLASTER, m.BRICK, m.CONCRETE)[rng.integers(3)].draw(rng)


@meshes.thing
def wall(rng: np.random.Generator, length_m: float, height_m: float) -> Mesh:
    """A free-standing wall along y with a plinth and a coping."""
    body, trim = wall_material(rng), m.CONCRETE.draw(rng)
    return meshes.join(
        [
            meshes.box((0.30, length_m, height_m), body, (-0.2, 0.0, 0.0)),
            meshes.box((0.36, length_m, 0.3), trim, (-0.2, 0.0, 0.0)),
            # A millimetre above, where two faces in one plane would take turns in the picture.
            meshes.box((0.40, length_m + 0.02, 0.08), trim, (-0.2, 0.0, height_m + 0.001)),
        ]
    )


@meshes.thing
def facade(rng: np.random.Generator, length_m: float, lit: bool = False) -> Mesh:
    """The street side of a building along y: plinth, ledge, rows of windows, doors."""
    height, body, trim = rng.uniform(6.0, 10.0), wall_material(rng), m.CONCRETE.draw(rng)
    parts = [
        meshes.box((4.0, length_m, height), body, (-2.0, 0.0, 0.0)),
        meshes.box((0.06, length_m, rng.uniform(0.3, 0.8)), trim, (0.03, 0.0, 0.0)),
        meshes.box((0.14, length_m, 0.18), trim, (0.07, 0.0, 3.0)),
    ]
    pitch = rng.uniform(1.9, 2.8)
    # Windows of the upper row stand above those of the lower; one of the lower is the door.
    openings = np.arange(-length_m / 2 + pitch / 2, length_m / 2 - pitch / 2 + 0.01, pitch)
    door = rng.integers(len(openings))
    for i, y in enumerate(openings):
        parts.append(door_leaf(rng, y) if i == door else window(rng, y, 1.05, lit))
        parts.append(window(rng, y, 3.9, lit))
    return meshes.join(parts)


def window(rng: np.random.Generator, y: float, sill_m: float, lit: bool) -> Mesh:
    """A framed pane, a sill; at night one window in three is lit."""
    frame, glass = m.WHITE_PAINT.draw(rng), m.GLASS.draw(rng)
    if lit and rng.random() < 0.3:
        glass = glass.glowing(ROOM_LIGHTING.draw_in_band(rng))
    half, top = 0.52, sill_m + 1.35
    panes = [(y - half + 0.07, y - 0.03), (y + 0.03, y + half - 0.07)]
    return meshes.join(
        [
            meshes.front((y - half, y + half), (sill_m, top), 0.012, frame),
            *(meshes.front(pane, (sill_m + 0.07, top - 0.07), 0.020, glass) for pane in panes),
            meshes.box((0.16, 2 * half + 0.1, 0.06), frame, (0.08, y, sill_m - 0.06)),
        ]
    )


def door_leaf(rng: np.random.Generator, y: float) -> Mesh:
    """A door with a frame and a step."""
    frame, leaf = m.CONCRETE.draw(rng), m.WOOD.draw(rng)
    return meshes.join(
        [
            meshes.front((y - 0.6, y + 0.6), (0.0, 2.3), 0.068, frame),
            meshes.front((y - 0.48, y + 0.48), (0.14, 2.18), 0.076, leaf),
            meshes.box((0.35, 1.2, 0.14), m.CONCRETE.draw(rng), (0.175, y, 0.0)),
        ]
    )


@meshes.thing
def roller_door(rng: np.random.Generator, width_m: float = 2.6) -> Mesh:
    """A garage door of horizontal slats in a concrete wall."""
    light, dark = m.METAL.draw(rng), m.DARK_METAL.draw(rng)
    slats = [
        meshes.box((0.04, width_m, 0.22), light if i % 2 else dark, (0.03, 0.0, 0.23 * i))
        for i in range(10)
    ]
    body = meshes.box((0.3, width_m + 2.0, 3.0), wall_material(rng), (-0.15, 0.0, 0.0))
    return meshes.join([body, *slats])


@meshes.thing
def pillar(rng: np.random.Generator, height_m: float) -> Mesh:
    """A square or round concrete pillar with a painted warning band."""
    concrete, paint, dark = m.CONCRETE.draw(rng), m.WHITE_PAINT.draw(rng), m.RUBBER.draw(rng)
    size = rng.uniform(0.3, 0.55)
    bands = [
        meshes.box(
            (size + 0.02, size + 0.02, 0.2), paint if i % 2 else dark, (0.0, 0.0, 0.3 + 0.2 * i)
        )
        for i in range(4)
    ]
    return meshes.join([meshes.box((size, size, height_m), concrete), *bands])


def tube_lamp(length_m: float, radiance: float, casing: Material, ceiling_m: float) -> Mesh:
    """A tube lamp along x under a ceiling, with its white casing."""
    shell = meshes.box((length_m + 0.1, 0.2, 0.08), casing, (0.0, 0.0, ceiling_m - 0.08))
    lens = meshes.box(
        (length_m, 0.12, 0.05), casing.glowing(radiance), (0.0, 0.0, ceiling_m - 0.131)
    )
    return meshes.join([shell, lens])


def arch(
    half_m: float, spring_m: float, crown_m: float, segments: int = 8
) -> list[tuple[float, float]]:
    """Cross-section (y, z) of a tunnel from right foot to left foot: walls, elliptic vault."""
    angles = np.linspace(0, np.pi, segments + 1)
    vault = [
        (-half_m * float(np.cos(a)), spring_m + (crown_m - spring_m) * float(np.sin(a)))
        for a in angles
    ]
    return [(-half_m, 0.0), *vault, (half_m, 0.0)]


def tunnel_tube(
    section: list[tuple[float, float]], x: tuple[float, float], lining: Material
) -> Mesh:
    """The inner face of a tunnel over a stretch of x."""
    strips = pairwise(section)
    return meshes.join(
        meshes.polygon([(x[0], *a), (x[1], *a), (x[1], *b), (x[0], *b)], lining) for a, b in strips
    )
