"""The triangles of a world at a set of instants, as plain arrays.

What stands still is one mesh in world coordinates. What moves is posed once per instant, and the
copies stand on a grid so wide that no ray of one instant can reach the copy of another: one
launch renders all instants, and shape counts never change.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shotenv.world.geometry import Arc, Mesh, Pose, World, rotation
from unwrap.support import inlined, loop

Array = np.ndarray

REACH_M = 150.0
"""Length of the longest ray; what lies beyond counts as sky."""


@dataclass(frozen=True)
class Faces:
    """What is known of the triangles of a world whatever the time. S static, then M moving ones.

    Attributes
    ----------
    still : int
        S.
    corners : float32 [S + M, 3, 3]
        In the world; of what moves in the coordinates of its thing. M is at least one.
    thing : int64 [M]
        Which of the world's things a moving face belongs to.
    radius_m : float64 [K]
        Of each thing, from the origin of its coordinates to its farthest corner.
    normals : float32 [S, 4]
        Unit normals of the static faces and a zero.
    surface : float32 [S + M, 4]
        Albedo where the noise texture is 0 and where it is 1, retro-reflection, emission.
    uv : float32 [S + M, 8]
        Texture coordinates of the first corner, then the edges to the other two, then the
        mirrored and the clear share.
    """

    still: int
    corners: np.ndarray
    thing: np.ndarray
    radius_m: np.ndarray
    normals: np.ndarray
    surface: np.ndarray
    uv: np.ndarray

    @property
    def is_pane(self) -> np.ndarray:
        """Whether light passes a face, bool [S + M]."""
        return self.uv[:, 7] > 0


@dataclass(frozen=True)
class Posed:
    """Where the M moving faces of a world are at T instants.

    Attributes
    ----------
    corners : float32 [T, M, 3, 3]
        World coordinates plus `tile_m` of the instant.
    normals : float32 [T, M, 4]
        Unit normals and a zero.
    panes : float32 [P, 3, 3]
        Corners of all faces that light passes, still or moving, at each instant, like `corners`.
    tile_m : float32 [T, 3]
        Where on the grid the copy of each instant stands.
    """

    corners: np.ndarray
    normals: np.ndarray
    panes: np.ndarray
    tile_m: np.ndarray


def faces_of(world: World) -> Faces:
    """The triangles of `world`."""
    moving = [thing.mesh for thing in world.moving]
    # A mesh cannot be empty, and without it the kernel would be another one.
    moving = moving if any(len(mesh.corners) for mesh in moving) else [_nothing(world)]
    meshes, still = [world.static, *moving], world.static.corners

    def columns(*names: str) -> Array:
        """Numbers of all faces, float32 [S + M, names]."""
        return np.stack([np.concatenate([getattr(m, name) for m in meshes]) for name in names], 1)

    normals = np.zeros((len(still), 4), np.float32)
    _find_normals(still.astype(float), normals)
    first, second, third = np.moveaxis(np.concatenate([mesh.uv for mesh in meshes]), 1, 0)
    farthest = [np.linalg.norm(mesh.corners, axis=-1).max(initial=0.0) for mesh in moving]
    return Faces(
        still=len(still),
        corners=np.concatenate([mesh.corners for mesh in meshes]),
        thing=np.repeat(np.arange(len(moving)), [len(mesh.corners) for mesh in moving]),
        radius_m=np.array(farthest, np.float64),
        normals=normals,
        # Four and eight numbers in a row: a face's are gathered as one or two packets of four.
        surface=columns("albedo_low", "albedo_high", "retro", "emission"),
        uv=np.concatenate([first, second - first, third - first, columns("mirror", "clear")], 1),
    )


def posed(world: World, faces: Faces, times_s: Sequence[float], bounces: int) -> Posed:
    """The moving ones of `faces` at `times_s` for light paths of at most `bounces` surface hits."""
    own = faces.corners[faces.still :]
    motions = [thing.motion for thing in world.moving] or [Arc(Pose((0.0, 0.0, 0.0)))]
    poses = [[motion.at(time_s) for motion in motions] for time_s in times_s]
    turns = np.array([[rotation(pose) for pose in row] for row in poses])
    places = np.array([[pose.position_m for pose in row] for row in poses])
    corners = np.empty((len(times_s), *own.shape), np.float32)
    normals = np.zeros((*corners.shape[:2], 4), np.float32)
    # No ray gets further from the camera than a leg per surface hit and one to a light, each of
    # `REACH_M`; no copy gets further than its place and its own size.
    away_m = np.abs(places - world.ego.at(times_s[0]).position_m)[..., :2].max(axis=-1)
    farthest_m = float((away_m + faces.radius_m).max())
    tile_m = tile_grid(len(times_s), spacing_m=farthest_m + (bounces + 1) * REACH_M)
    _pose(own, faces.thing, turns, places, tile_m, corners, normals)
    still, moves = np.split(faces.is_pane, [faces.still])
    still_panes = faces.corners[: faces.still][still] + tile_m[:, None, None, :]
    panes = np.concatenate([still_panes.astype(np.float32), corners[:, moves]], axis=1)
    return Posed(corners, normals, panes.reshape(-1, 3, 3), tile_m.astype(np.float32))


def tile_grid(count: int, spacing_m: float) -> np.ndarray:
    """Offsets [count, 3] on a square grid about the origin, metres; spacing in whole metres."""
    side = math.ceil(math.sqrt(count))
    row, column = np.divmod(np.arange(count), side)
    # About the origin and in whole metres: float32 corners keep most digits of what is small.
    offsets = np.stack([column - (side - 1) / 2, row - row.max() / 2, np.zeros(count)], axis=1)
    return offsets * math.ceil(spacing_m)


@inlined
def _in_world(turn, place, point):
    """A point of a thing, in the thing's coordinates, to the world's."""
    x, y, z = point[0], point[1], point[2]
    return (
        turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z + place[0],
        turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z + place[1],
        turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z + place[2],
    )


@inlined
def _normal(first, second, third):
    """Unit normal of a triangle; zeros if it has no area."""
    ax, ay, az = second[0] - first[0], second[1] - first[1], second[2] - first[2]
    bx, by, bz = third[0] - first[0], third[1] - first[1], third[2] - first[2]
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = np.sqrt(x * x + y * y + z * z)
    # A face without area, such as `_nothing`'s, is never hit, but NaN would spread in its lane.
    scale = length if length > 0.0 else 1.0
    return x / scale, y / scale, z / scale


@loop
def _pose(
    own: Array,
    thing: Array,
    turns: Array,
    places: Array,
    tile_m: Array,
    corners: Array,
    normals: Array,
) -> None:
    """Pose the faces [M, 3, 3] of things at T instants.

    Parameters
    ----------
    thing : int64 [M]
        Which thing a face belongs to.
    turns, places : float64 [T, K, 3, 3] and [T, K, 3]
        Rotations and places of the things.
    tile_m : float64 [T, 3]
        Is added to the corners.
    corners, normals : float32 [T, M, 3, 3] and [T, M, 4]
        Are written.
    """
    for t in range(len(turns)):
        for face in range(len(own)):
            turn, place = turns[t, thing[face]], places[t, thing[face]]
            first = _in_world(turn, place, own[face, 0])
            second = _in_world(turn, place, own[face, 1])
            third = _in_world(turn, place, own[face, 2])
            normal = _normal(first, second, third)
            for axis in range(3):
                corners[t, face, 0, axis] = first[axis] + tile_m[t, axis]
                corners[t, face, 1, axis] = second[axis] + tile_m[t, axis]
                corners[t, face, 2, axis] = third[axis] + tile_m[t, axis]
                normals[t, face, axis] = normal[axis]


@loop
def _find_normals(corners: Array, normals: Array) -> None:
    """Unit normals, into float32 [F, 4], of faces float64 [F, 3, 3]."""
    for face in range(len(corners)):
        normal = _normal(corners[face, 0], corners[face, 1], corners[face, 2])
        for axis in range(3):
            normals[face, axis] = normal[axis]


def _nothing(world: World) -> Mesh:
    """A triangle without area below the ego, for worlds in which nothing moves."""
    zero = np.zeros(1, np.float32)
    buried = np.asarray(world.ego.at(0.0).position_m) - (0.0, 0.0, 10.0)
    corners = np.broadcast_to(buried.astype(np.float32), (1, 3, 3))
    uv = np.zeros((1, 3, 2), np.float32)
    return Mesh(corners, uv, zero, zero, zero, zero, zero, zero)
