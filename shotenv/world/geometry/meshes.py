"""Building blocks: primitives as triangle soups, joined and placed.

Solids stand on their `base`, the centre of their lowest face, so that things rest on what is
below them. Texture coordinates are projected along the axis nearest to each face's normal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, replace
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np
import trimesh

from shotenv.world.geometry.materials import Material
from shotenv.world.geometry.model import Mesh
from shotenv.world.geometry.motion import Pose

P = ParamSpec("P")
Drawn = TypeVar("Drawn")
"""A `Mesh` or a `Mover`: both have `kinds`."""
Point = tuple[float, float, float]
ORIGIN: Point = (0.0, 0.0, 0.0)
_NEXT, _AFTER = [1, 2, 0], [2, 0, 1]
"""The two axes that follow x, y and z in turn: factors of a cross product."""
_ACROSS = np.array([(1, 2), (0, 2), (0, 1)])
"""The two axes across x, y and z."""
_PER_FACE = ("albedo_low", "albedo_high", "retro", "emission", "mirror", "clear")
_CORNERS = np.arange(3)[None, :, None]


def soup(corners: np.ndarray, material: Material) -> Mesh:
    """Triangles [F, 3, 3] in metres, all of one material."""
    # One material for all faces now; once joined, faces of many lie in the same arrays.
    numbers = np.array([getattr(material, name) for name in _PER_FACE], dtype=np.float32)
    per_face = numbers[:, None].repeat(len(corners), axis=1)
    return Mesh(
        corners=np.asarray(corners, dtype=np.float32),
        uv=box_projection(corners, material),
        **dict(zip(_PER_FACE, per_face, strict=True)),
    )


def box_projection(corners: np.ndarray, material: Material) -> np.ndarray:
    """Texture coordinates [F, 3, 2]: the two axes across the face's main normal axis."""
    across = _ACROSS[np.abs(area_vectors(corners)).argmax(axis=1)]
    metres = corners[np.arange(len(corners))[:, None, None], _CORNERS, across[:, None, :]]
    return (metres / material.texture_m + material.offset).astype(np.float32)


def area_vectors(corners: np.ndarray) -> np.ndarray:
    """Normals [F, 3] of triangles [F, 3, 3], as long as twice their area."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return cross(u, v)


def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Cross products of vectors [..., 3].

    `np.cross` spends most of its time on checks; worlds are made of thousands of small calls.
    """
    return u.take(_NEXT, -1) * v.take(_AFTER, -1) - u.take(_AFTER, -1) * v.take(_NEXT, -1)


def join(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh of all the faces."""
    parts = list(meshes)
    arrays = [field.name for field in fields(Mesh) if field.name != "kinds"]
    return Mesh(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in arrays},
        kinds=frozenset().union(*(part.kinds for part in parts)),
    )


def thing(draw: Callable[P, Drawn]) -> Callable[P, Drawn]:
    """Mark what `draw` makes as a thing of the kind that the function is named after."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> Drawn:
        made: Any = draw(*args, **kwargs)
        return replace(made, kinds=made.kinds | {draw.__name__})

    return drawn


def place(mesh: Mesh, pose: Pose) -> Mesh:
    """`mesh` turned by the pose's yaw about z, then moved."""
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    corners = mesh.corners.astype(np.float64) @ turn.T + np.asarray(pose.position_m)
    return replace(mesh, corners=corners.astype(np.float32))


def at(mesh: Mesh, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> Mesh:
    """`mesh` turned by `yaw` about z and moved to (x, y, z)."""
    return place(mesh, Pose((x, y, z), yaw))


def grounded(mesh: Mesh) -> Mesh:
    """`mesh` raised or lowered until its lowest corner is at z = 0."""
    return at(mesh, 0.0, 0.0, -float(mesh.corners[..., 2].min()))


def scaled(mesh: Mesh, factors: Point) -> Mesh:
    """`mesh` stretched along each axis."""
    return replace(mesh, corners=mesh.corners * np.asarray(factors, dtype=np.float32))


def frame(outline: Sequence[Point], pane: Sequence[Point] | np.ndarray, material: Material) -> Mesh:
    """What is left of a polygon around a pane cut out of it, both with as many corners."""
    outer, inner = list(outline), list(pane)
    return join(
        polygon([outer[i - 1], outer[i], inner[i], inner[i - 1]], material)
        for i in range(len(outer))
    )


def polygon(points: Sequence[Point] | np.ndarray, material: Material) -> Mesh:
    """A flat convex polygon, corners counter-clockwise seen from its front."""
    ring = np.asarray(points, dtype=np.float64)
    # A fan of triangles about the first corner: right for convex outlines alone.
    first = np.broadcast_to(ring[:1], (len(ring) - 2, 3))
    return soup(np.stack([first, ring[1:-1], ring[2:]], axis=1), material)


def inset(points: Sequence[Point], share: float, lift_m: float) -> np.ndarray:
    """Corners of a polygon drawn in towards its centre and lifted along its normal."""
    ring = np.asarray(points, dtype=np.float64)
    normal = area_vectors(ring[None, :3])[0]
    centre = ring.mean(axis=0)
    drawn = centre + (ring - centre) * (1 - share)
    return drawn + lift_m * normal / np.linalg.norm(normal)


def patch(x: tuple[float, float], y: tuple[float, float], z: float, material: Material) -> Mesh:
    """A level rectangle facing up."""
    return polygon([(x[0], y[0], z), (x[1], y[0], z), (x[1], y[1], z), (x[0], y[1], z)], material)


def front(y: tuple[float, float], z: tuple[float, float], x: float, material: Material) -> Mesh:
    """An upright rectangle facing +x."""
    return polygon([(x, y[0], z[0]), (x, y[1], z[0]), (x, y[1], z[1]), (x, y[0], z[1])], material)


def back(y: tuple[float, float], z: tuple[float, float], x: float, material: Material) -> Mesh:
    """An upright rectangle facing -x."""
    return polygon([(x, y[1], z[0]), (x, y[0], z[0]), (x, y[0], z[1]), (x, y[1], z[1])], material)


def box(size: Point, material: Material, base: Point = ORIGIN) -> Mesh:
    """A box of `size` whose lowest face is centred on `base`."""
    centre = np.array(base) + np.array([0.0, 0.0, size[2] / 2])
    return soup(_unit_box() * np.array(size) + centre, material)


def rod(
    start: Sequence[float],
    end: Sequence[float],
    radius: float,
    material: Material,
    sections: int = 8,
) -> Mesh:
    """A capped cylinder between two points."""
    axis = np.subtract(end, start)
    # The axis of space that is most across the rod gives the least rounding.
    length = np.linalg.norm(axis)
    side = cross(axis / length, np.eye(3)[np.abs(axis).argmin()])
    side *= radius / np.linalg.norm(side)
    across = cross(axis / length, side)
    frame = np.stack([side, across, axis])
    return soup(_unit_cylinder(sections) @ frame + np.asarray(start), material)


def lathe(
    profile: Sequence[tuple[float, float]],
    material: Material,
    base: Point = ORIGIN,
    sections: int = 8,
) -> Mesh:
    """A solid of revolution about z; `profile` is (radius, height) from bottom to top."""
    radius, height = np.asarray(profile, dtype=np.float64).T[..., None]
    turn = np.linspace(0.0, 2 * np.pi, sections + 1)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    ring = np.stack([x, y, np.broadcast_to(height, x.shape)], axis=-1)
    a, b, c, d = ring[:-1, :-1], ring[:-1, 1:], ring[1:, 1:], ring[1:, :-1]
    triangles = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3, 3) + np.asarray(base)
    # Where the profile meets the axis, half of each quadrilateral has no area.
    area = np.linalg.norm(area_vectors(triangles), axis=1)
    return soup(triangles[area > 1e-9], material)


def ball(radius: float, material: Material, centre: Point, detail: int = 1) -> Mesh:
    """An icosphere; `detail` 0 has 20 faces, 1 has 80."""
    vertices, faces = _unit_icosphere(detail)
    return soup(vertices[faces] * radius + np.asarray(centre), material)


def blob(
    rng: np.random.Generator, radius: float, material: Material, centre: Point, detail: int = 1
) -> Mesh:
    """A lumpy ball: each vertex of an icosphere pushed in or out."""
    vertices, faces = _unit_icosphere(detail)
    lumps = radius * rng.uniform(0.7, 1.25, size=(len(vertices), 1))
    return soup((vertices * lumps)[faces] + np.asarray(centre), material)


@cache
def _unit_box() -> np.ndarray:
    return np.array(trimesh.creation.box(extents=(1.0, 1.0, 1.0)).triangles)


@cache
def _unit_cylinder(sections: int) -> np.ndarray:
    solid = trimesh.creation.cylinder(radius=1.0, height=1.0, sections=sections)
    return np.array(solid.triangles) + np.array([0.0, 0.0, 0.5])


@cache
def _unit_icosphere(detail: int) -> tuple[np.ndarray, np.ndarray]:
    solid = trimesh.creation.icosphere(subdivisions=detail, radius=1.0)
    return np.array(solid.vertices), np.array(solid.faces)


def extrude(profile: Sequence[tuple[float, float]], width: float, material: Material) -> Mesh:
    """A prism: a convex profile of (x, z) points, counter-clockwise seen from -y, along y."""
    near = [(x, -width / 2, z) for x, z in profile]
    far = [(x, width / 2, z) for x, z in profile]
    following = range(1, len(profile) + 1)
    sides = [
        polygon([near[i - 1], far[i - 1], far[i % len(far)], near[i % len(far)]], material)
        for i in following
    ]
    return join([polygon(near, material), polygon(far[::-1], material), *sides])
