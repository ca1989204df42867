"""Things that move and have parts that turn: a body on its route, wheels and limbs hinged to it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from shotenv.world.geometry import meshes
from shotenv.world.geometry.model import Mesh, MovingObject
from shotenv.world.geometry.motion import Arc, Motion, Pose, Route, pose_of, rotation
from unwrap.support import Range

HERE = Arc(Pose((0.0, 0.0, 0.0)))
"""The route of what stands at the origin."""
SWEPT_INSTANTS = 12
"""Instants of a clip at which the ground under moving limbs is looked at: a few in each step."""


def attached(body: Pose, hinge_m: meshes.Point, pitch_rad: float) -> Pose:
    """Pose of a part that is hinged to a body and turned by `pitch_rad` about the body's y axis.

    Exact for every pose of the body: the product of both rotations is a pose again.
    """
    x, y, z = body.position_m
    if body.roll_rad == 0.0:
        # Turns about one axis add up; only roll stands between the two pitches.
        cos_yaw, sin_yaw = math.cos(body.yaw_rad), math.sin(body.yaw_rad)
        cos_pitch, sin_pitch = math.cos(body.pitch_rad), math.sin(body.pitch_rad)
        along = hinge_m[0] * cos_pitch + hinge_m[2] * sin_pitch
        place = (
            x + along * cos_yaw - hinge_m[1] * sin_yaw,
            y + along * sin_yaw + hinge_m[1] * cos_yaw,
            z + hinge_m[2] * cos_pitch - hinge_m[0] * sin_pitch,
        )
        return Pose(place, body.yaw_rad, body.pitch_rad + pitch_rad)
    turn = rotation(body)
    dx, dy, dz = (turn @ np.array(hinge_m)).tolist()
    return pose_of(turn @ rotation(Pose(hinge_m, pitch_rad=pitch_rad)), (x + dx, y + dy, z + dz))


class Part(Protocol):
    """Something on a mover that has a motion of its own while the mover goes along its route."""

    def on(self, route: Route, span_s: Range) -> Iterable[MovingObject]:
        """The part's pieces on a mover whose origin goes along `route` from span_s[0] to [1]."""


@dataclass(frozen=True)
class Mover:
    """What moves, as it is drawn: parts, the first of them what lamps are fixed to.

    On a route it becomes one `MovingObject` for each piece that turns by itself.
    """

    parts: tuple[Part, ...]
    kinds: frozenset[str] = field(default_factory=frozenset)

    def on(self, route: Route, span_s: Range) -> tuple[MovingObject, ...]:
        """All pieces on a route, for times from span_s[0] to span_s[1]."""
        first, *rest = [piece for part in self.parts for piece in part.on(route, span_s)]
        kinds = first.mesh.kinds | self.kinds
        return replace(first, mesh=replace(first.mesh, kinds=kinds)), *rest

    @cached_property
    def at_rest(self) -> Mesh:
        """The same thing standing at the origin, in one piece."""
        return meshes.join(
            posed(piece.mesh, piece.motion.at(0.0)) for piece in self.on(HERE, (0.0, 0.0))
        )


def posed(mesh: Mesh, pose: Pose) -> Mesh:
    """`mesh` turned by all three angles of a pose, then moved."""
    corners = mesh.corners.astype(np.float64) @ rotation(pose).T + np.asarray(pose.position_m)
    return replace(mesh, corners=corners.astype(np.float32))


def swept(
    pieces: Sequence[MovingObject], route: Route, span_s: Range, below_m: float
) -> np.ndarray:
    """Corners [5, 3] around what pieces sweep in the axes of their route, above its ground.

    Four are the rectangle on the ground around all that is lower than `below_m`; one is as high
    as the highest corner.
    """
    times = np.linspace(*span_s, SWEPT_INSTANTS)
    bodies = [route.at(time) for time in times]
    lows, highs, top = [], [], 0.0
    for piece in pieces:
        points = piece.mesh.corners.reshape(-1, 3).astype(np.float64)
        if piece.motion is not route:
            # Eight corners stand for all of a limb or a wheel, which makes it a little larger.
            corners = np.array([points.min(axis=0), points.max(axis=0)])
            box = np.stack([corners[i, range(3)] for i in np.ndindex(2, 2, 2)])
            points = _seen_from(bodies, [piece.motion.at(time) for time in times], box)
        top = max(top, float(points[:, 2].max()))
        low = points[points[:, 2] < below_m, :2]
        if len(low):
            lows.append(low.min(axis=0))
            highs.append(low.max(axis=0))
    (x0, y0), (x1, y1) = np.min(lows, axis=0), np.max(highs, axis=0)
    ring = [(x0, y0, 0.0), (x1, y0, 0.0), (x1, y1, 0.0), (x0, y1, 0.0), (x0, y0, top)]
    return np.array(ring)


def _seen_from(bodies: list[Pose], poses: list[Pose], points: np.ndarray) -> np.ndarray:
    """Points [N, 3] of a part at T poses [T N, 3], in the axes of bodies that stand upright."""
    turns = np.array([rotation(pose) for pose in poses])
    away = (
        points @ turns.swapaxes(1, 2)
        + np.array(
            [
                np.subtract(pose.position_m, body.position_m)
                for pose, body in zip(poses, bodies, strict=True)
            ]
        )[:, None]
    )
    back = np.array([rotation(Pose(body.position_m, body.yaw_rad)) for body in bodies])
    return (away @ back).reshape(-1, 3)


@dataclass(frozen=True)
class Rigid:
    """What keeps still on its mover."""

    mesh: Mesh

    def on(self, route: Route, span_s: Range) -> Iterable[MovingObject]:
        """The mesh on the route itself."""
        return (MovingObject(self.mesh, route),)


@dataclass(frozen=True)
class Wheels:
    """Wheels about one axle along y; their mesh has its origin in the middle of the axle."""

    mesh: Mesh
    hub_m: meshes.Point
    radius_m: float

    def on(self, route: Route, span_s: Range) -> Iterable[MovingObject]:
        """The wheels, rolling without slip."""
        return (MovingObject(self.mesh, Rolling(route, self.hub_m, self.radius_m)),)


@dataclass(frozen=True)
class Rolling:
    """Motion of a wheel that turns by way / radius, forwards being nose down."""

    body: Route
    hub_m: meshes.Point
    radius_m: float

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`."""
        return attached(self.body.at(time_s), self.hub_m, self.body.way_m(time_s) / self.radius_m)


@dataclass(frozen=True)
class Along:
    """A path that is gone along at a changing speed, smooth between instants at equal steps.

    Attributes
    ----------
    path : Motion
        Pose after each metre of the way, in place of each second: an `Arc` at 1 m/s.
    start_s, step_s : float
        Time of the first instant, and between two.
    ways_m, speeds_m_s : tuple of float
        Way along the path, from its start, and speed at the instants. Before the first and after
        the last one the speed stays what it is there.
    """

    path: Motion
    start_s: float
    step_s: float
    ways_m: tuple[float, ...]
    speeds_m_s: tuple[float, ...]

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`."""
        return self.path.at(self.way_m(time_s))

    def way_m(self, time_s: float) -> float:
        """Way along the path, metres: cubic Hermite between two instants."""
        steps = (time_s - self.start_s) / self.step_s
        last = len(self.ways_m) - 1
        i = int(min(max(steps, 0.0), last - 1.0))
        u = steps - i
        if not 0.0 <= u <= 1.0:
            edge = 0 if u < 0.0 else last
            return self.ways_m[edge] + self.speeds_m_s[edge] * (steps - edge) * self.step_s
        before, after = self.ways_m[i], self.ways_m[i + 1]
        leave, arrive = self.speeds_m_s[i] * self.step_s, self.speeds_m_s[i + 1] * self.step_s
        rise = after - before
        bend = leave + arrive - 2.0 * rise
        return before + u * (leave + u * (rise - leave - bend + u * bend))
