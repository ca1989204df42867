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

from shotenv.world.model import Mesh, Pose, World

REACH_M = 150.0
"""Length of the longest ray; what lies beyond counts as sky."""


@dataclass(frozen=True)
class Geometry:
    """Triangles and what is known of each. S static faces, M moving faces, T instants.

    Attributes
    ----------
    static_faces : int
        S; what stands still is traced in world coordinates.
    moving : float32 [T * M, 3, 3]
        Corners of what moves at each instant, world coordinates plus `tile_m` of the instant.
    panes : float32 [P, 3, 3]
        Corners of all faces that light passes, still or moving, at each instant, like `moving`.
    tile_m : float32 [T, 3]
        Where on the grid the copy of each instant stands.
    normals : float32 [S + T * M, 4]
        Unit face normals and a zero.
    surface : float32 [S + M, 4]
        Albedo where the noise texture is 0 and where it is 1, retro-reflection, emission.
    uv : float32 [S + M, 8]
        Texture coordinates of the first corner, then the edges to the other two, then the
        mirrored and the clear share.
    """

    static_faces: int
    moving: np.ndarray
    panes: np.ndarray
    tile_m: np.ndarray
    normals: np.ndarray
    surface: np.ndarray
    uv: np.ndarray


def rotation(pose: Pose) -> np.ndarray:
    """Matrix [3, 3] from a pose's own axes to the world: pitch about y first, then yaw about z.

    Both turn by the right-hand rule, so that a positive pitch looks down.
    """
    cy, sy = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    cp, sp = math.cos(pose.pitch_rad), math.sin(pose.pitch_rad)
    return np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])


def geometry_at(world: World, times_s: Sequence[float], bounces: int) -> Geometry:
    """Triangles of `world` at `times_s` for light paths of at most `bounces` surface hits."""
    moving = _posed(world, times_s)
    radius_m = _reach_from(world.ego.at(times_s[0]), moving)
    tile = tile_grid(len(times_s), spacing_m=radius_m + (bounces + 1) * REACH_M)
    meshes = [world.static, *(thing.mesh for thing in world.moving), *_padding(world)]
    clear = np.concatenate([mesh.clear for mesh in meshes]) > 0
    still, moves = np.split(clear, [len(world.static.corners)])
    at_tile = tile[:, None, None, :]
    panes = (world.static.corners[still] + at_tile, moving[:, moves] + at_tile)
    return Geometry(
        static_faces=len(world.static.corners),
        moving=(moving + at_tile).reshape(-1, 3, 3).astype(np.float32),
        panes=np.concatenate(panes, axis=1).reshape(-1, 3, 3).astype(np.float32),
        tile_m=tile.astype(np.float32),
        normals=_normals(np.concatenate([world.static.corners, moving.reshape(-1, 3, 3)])),
        surface=np.concatenate([_surface(mesh) for mesh in meshes]),
        uv=np.concatenate([_edges_uv(mesh) for mesh in meshes]),
    )


def _reach_from(eye: Pose, corners: np.ndarray) -> float:
    """Largest distance along x or y from the eye to corners [..., 3], metres."""
    # One column at a time: NumPy reduces short last axes slowly.
    columns = (corners[..., axis] for axis in (0, 1))
    ends = ((column.min(), column.max()) for column in columns)
    return max(
        max(high - at, at - low) for (low, high), at in zip(ends, eye.position_m, strict=False)
    )


def tile_grid(count: int, spacing_m: float) -> np.ndarray:
    """Offsets [count, 3] on a square grid about the origin, metres; spacing in whole metres."""
    side = math.ceil(math.sqrt(count))
    row, column = np.divmod(np.arange(count), side)
    offsets = np.stack([column - (side - 1) / 2, row - row.max() / 2, np.zeros(count)], axis=1)
    return offsets * math.ceil(spacing_m)


def _posed(world: World, times_s: Sequence[float]) -> np.ndarray:
    """Corners [T, M, 3, 3] of everything that moves, float64, at `times_s`; M is at least one."""
    parts = [
        _placed(thing.mesh.corners, [thing.motion.at(t) for t in times_s]) for thing in world.moving
    ]
    still = Pose((0.0, 0.0, 0.0))
    parts += [_placed(mesh.corners, [still] * len(times_s)) for mesh in _padding(world)]
    return np.concatenate(parts, axis=1)


def _placed(corners: np.ndarray, poses: Sequence[Pose]) -> np.ndarray:
    """Corners [M, 3, 3] in each of T poses, [T, M, 3, 3]."""
    turns = np.stack([rotation(pose).T for pose in poses])
    points = corners.reshape(-1, 3).astype(float) @ turns
    points += np.array([pose.position_m for pose in poses])[:, None]
    return points.reshape(len(poses), -1, 3, 3)


def _padding(world: World) -> list[Mesh]:
    """A triangle without area for worlds in which nothing moves: a mesh cannot be empty."""
    if any(len(thing.mesh.corners) for thing in world.moving):
        return []
    zero = np.zeros(1, np.float32)
    buried = np.asarray(world.ego.start.position_m) - (0.0, 0.0, 10.0)
    corners = np.broadcast_to(buried.astype(np.float32), (1, 3, 3))
    uv = np.zeros((1, 3, 2), np.float32)
    return [Mesh(corners, uv, zero, zero, zero, zero, zero, zero)]


def _normals(corners: np.ndarray) -> np.ndarray:
    # np.cross and sums over a short last axis are several times slower on so many triangles.
    (ax, ay, az), (bx, by, bz) = ((corners[:, i] - corners[:, 0]).T.copy() for i in (1, 2))
    normal = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])
    length = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    unit = np.zeros((len(corners), 4), np.float32)
    unit[:, :3] = (normal / np.where(length > 0, length, 1.0)).T
    return unit


def _surface(mesh: Mesh) -> np.ndarray:
    columns = (mesh.albedo_low, mesh.albedo_high, mesh.retro, mesh.emission)
    return np.stack(columns, axis=1).astype(np.float32)


def _edges_uv(mesh: Mesh) -> np.ndarray:
    first, second, third = np.moveaxis(mesh.uv.astype(np.float32), 1, 0)
    shares = np.stack([mesh.mirror, mesh.clear], axis=1).astype(np.float32)
    return np.concatenate([first, second - first, third - first, shares], axis=1)
