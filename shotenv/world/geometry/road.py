"""Curves on the ground: the way of a vehicle, and the road along which a site is bent."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from shotenv.world.geometry.meshes import area_vectors
from shotenv.world.geometry.model import Mesh
from shotenv.world.geometry.motion import Motion, Pose, Route
from unwrap.support import Range

STEP_M = 0.25
"""Between the points of a curve that are summed up once; in between it is an arc."""
WAY_STEP_S = 0.05
"""Between the instants at which the way along a bent route is summed up: at 3 m/s2 it errs by a
millimetre in between."""
SAGITTA_M = 0.01
"""How far a straight edge may leave the bend that it stands for."""
LONGEST_RIGID_M = 12.5
"""Things longer than this along the road, such as walls and rails, are bent with it."""
MITRE_M = 0.05
"""How much nearer another part of the road must be for ground to belong to that one."""


@dataclass(frozen=True)
class Curve:
    """A way on the ground by its curvature, linear between knots: lines, arcs, clothoids.

    Attributes
    ----------
    knots : tuple of (distance, curvature)
        Metres along the way and 1/m, positive to the left; straight before the first knot and
        after the last one.
    origin_m : float
        Where along the way it passes through (origin_m, 0) heading along +x.
    reverse_from_m : float
        From this distance on the vehicle goes backwards, still further along the way.
    """

    knots: tuple[tuple[float, float], ...] = ()
    origin_m: float = 0.0
    reverse_from_m: float = np.inf

    def at(self, distance_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """x, y and heading float64 [N] at distances [N] along the way."""
        if not self.knots and not np.isfinite(self.reverse_from_m):
            return (
                np.asarray(distance_m, float),
                np.zeros_like(distance_m),
                np.zeros_like(distance_m),
            )
        x, y, heading = self._along(np.asarray(distance_m, float))
        x0, y0, turn = self._origin
        cos, sin = np.cos(turn), np.sin(turn)
        x, y = x - x0, y - y0
        return self.origin_m + cos * x + sin * y, cos * y - sin * x, heading - turn

    @property
    def sharpest(self) -> float:
        """Greatest curvature, 1/m."""
        return max((abs(curvature) for _, curvature in self.knots), default=0.0)

    def sharpest_between(self, low_m: float, high_m: float) -> float:
        """Greatest curvature between two distances along the way, 1/m."""
        if not self.knots:
            return 0.0
        at, curvature = np.array(self.knots).T
        asked = np.array([low_m, *at[(at > low_m) & (at < high_m)], high_m])
        return float(np.abs(np.interp(asked, at, curvature, left=0.0, right=0.0)).max())

    def _along(self, distance: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Like `at`, in the axes of the curve's first point."""
        grid, x, y, heading, curvature, gear = self._points
        cell = np.clip(((distance - grid[0]) / STEP_M).astype(int), 0, len(grid) - 2)
        step = distance - grid[cell]
        return _arc(x[cell], y[cell], heading[cell], curvature[cell], curvature[cell + 1],
                    gear[cell], step)  # fmt: skip

    @cached_property
    def _origin(self) -> tuple[float, float, float]:
        x, y, heading = self._along(np.array([self.origin_m]))
        return float(x[0]), float(y[0]), float(heading[0])

    @cached_property
    def _points(self) -> tuple[np.ndarray, ...]:
        """Grid of distances, and x, y, heading, curvature and gear (+1 or -1) there."""
        at = [distance for distance, _ in self.knots] or [0.0]
        last = max(at[-1], self.reverse_from_m if np.isfinite(self.reverse_from_m) else at[-1])
        # One straight step at either end, from which the curve is continued; the grid is shifted
        # so that the vehicle changes gear at one of its points.
        first = min(at[0], self.reverse_from_m) - 2 * STEP_M
        if np.isfinite(self.reverse_from_m):
            steps = np.ceil((self.reverse_from_m - first) / STEP_M)
            first = self.reverse_from_m - steps * STEP_M
        grid = first + STEP_M * np.arange(int(np.ceil((last - first) / STEP_M)) + 4)
        curvature = np.zeros_like(grid)
        if self.knots:
            inside = (grid >= at[0]) & (grid <= at[-1])
            curvature[inside] = np.interp(grid[inside], at, [c for _, c in self.knots])
        gear = np.where(grid < self.reverse_from_m - STEP_M / 2, 1.0, -1.0)
        mean = (curvature[:-1] + curvature[1:]) / 2
        heading = np.concatenate([[0.0], np.cumsum(gear[:-1] * mean * STEP_M)])
        nothing = np.zeros(len(grid) - 1)
        x, y, _ = _arc(nothing, nothing, heading[:-1], curvature[:-1], curvature[1:], gear[:-1],
                       np.full(len(nothing), STEP_M))  # fmt: skip
        x, y = (np.concatenate([[0.0], np.cumsum(steps)]) for steps in (x, y))
        return grid, x, y, heading, curvature, gear


STRAIGHT = Curve()


def _arc(x, y, heading, curvature, following, gear, step):
    """Point and heading `step` metres into a cell of which the first point is given."""
    # Beyond the ends of the grid the way goes on straight: no slope of the curvature there.
    slope = np.where(step <= STEP_M, (following - curvature) / STEP_M, 0.0)
    turn = gear * (curvature * step + slope * step**2 / 2)
    middle = heading + gear * (curvature * step / 2 + slope * step**2 / 8)
    # Chord over arc: sin(h) / h with h half the turn; numpy's sinc is of pi times its argument.
    chord = gear * step * np.sinc(turn / (2 * np.pi))
    return x + chord * np.cos(middle), y + chord * np.sin(middle), heading + turn


@dataclass(frozen=True)
class Bent:
    """A motion that is told along a straight road, on the bent one."""

    motion: Motion
    road: Curve

    def at(self, time_s: float) -> Pose:
        """Pose at `time_s`."""
        return bent_pose(self.road, self.motion.at(time_s))


@dataclass(frozen=True)
class BentRoute(Bent):
    """A route that is told along a straight road, on the bent one, over a span of time."""

    motion: Route
    span_s: Range

    def way_m(self, time_s: float) -> float:
        """Way since time 0, metres: outside in a bend it is longer than along the road."""
        times, ways, paces = self._table
        i = int(np.clip((time_s - times[0]) / WAY_STEP_S, 0, len(paces) - 1))
        return float(ways[i] + paces[i] * (time_s - times[i]))

    @cached_property
    def _table(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Instants, the way at each since time 0, and the speed from one to the next."""
        start, end = self.span_s
        # From time 0 on either way, so that it is one of them.
        before, after = (int(np.ceil(max(0.0, v) / WAY_STEP_S)) + 2 for v in (-start, end))
        times = WAY_STEP_S * np.arange(-before, after + 1)
        places = np.array([self.at(time).position_m[:2] for time in times])
        told = np.diff([self.motion.way_m(time) for time in times])
        steps = np.sign(told) * np.linalg.norm(np.diff(places, axis=0), axis=1)
        ways = np.concatenate([[0.0], np.cumsum(steps)])
        return times, ways - ways[before], steps / WAY_STEP_S


def bent_pose(road: Curve, pose: Pose) -> Pose:
    """A pose told along and across a road, in the world."""
    along, across, z = pose.position_m
    (x,), (y,), (heading,) = road.at(np.array([along]))
    place = (float(x - across * np.sin(heading)), float(y + across * np.cos(heading)), z)
    return replace(pose, position_m=place, yaw_rad=pose.yaw_rad + float(heading))


def bent_points(road: Curve, points: np.ndarray, anchor_m: np.ndarray | None = None) -> np.ndarray:
    """Points float64 [..., 3] told along, across and above a road, in the world.

    With an anchor [...] a point moves with the road as it is there, as part of a rigid thing.
    """
    along, across = points[..., 0], points[..., 1]
    anchor = along if anchor_m is None else np.where(np.isnan(anchor_m), along, anchor_m)
    x, y, heading = (v.reshape(along.shape) for v in road.at(anchor.ravel()))
    cos, sin, ahead = np.cos(heading), np.sin(heading), along - anchor
    moved = (x + ahead * cos - across * sin, y + ahead * sin + across * cos, points[..., 2])
    return np.stack(moved, axis=-1)


def is_own_ground(road: Curve, points: np.ndarray, world: np.ndarray) -> np.ndarray:
    """Whether no other part of a road is nearer to points [N, 3], bool [N].

    Inside a tight bend, one place is reached from two parts of the road: each has its side of the
    line that halves the bend.
    """
    own = np.ones(len(points), bool)
    if not road.knots:
        return own
    # Nearer than most of the tightest radius no other part can be nearer.
    asked = np.abs(points[:, 1]) * road.sharpest > 0.8
    if asked.any():
        reach = np.abs(points[asked, 1]).max()
        low, high = points[asked, 0].min() - 4 * reach, points[asked, 0].max() + 4 * reach
        x, y, _ = road.at(np.arange(low, high, 0.5))
        square = (world[asked, :1] - x) ** 2 + (world[asked, 1:2] - y) ** 2
        nearest = np.sqrt(square.min(axis=1))
        own[asked] = nearest > np.abs(points[asked, 1]) - MITRE_M
    return own


def bent_mesh(road: Curve, mesh: Mesh, anchor_m: np.ndarray) -> Mesh:
    """`mesh` told along a straight road, on the bent one.

    Parameters
    ----------
    anchor_m : float64 [F]
        Where along the road the rigid thing stands that a face belongs to; NaN for faces that bend
        with the road, which are cut into pieces for it, and left out inside of tight bends;
        infinity for faces that are told in the world and stay as they are.
    """
    bends = np.isnan(anchor_m)
    cut = cut_along(_of(mesh, bends), stations_m(road))
    mesh = _beside(_of(mesh, ~bends), cut)
    anchor = np.concatenate([anchor_m[~bends], np.full(len(cut.corners), np.nan)])
    points, moves = mesh.corners.astype(np.float64), ~np.isinf(anchor)
    world = points.copy()
    world[moves] = bent_points(road, points[moves], np.repeat(anchor[moves, None], 3, axis=1))
    keep = ~np.isnan(anchor)
    keep[~keep] = is_own_ground(road, points[~keep].mean(axis=1), world[~keep].mean(axis=1))
    return _of(replace(mesh, corners=world.astype(np.float32)), keep)


def stations_m(road: Curve) -> np.ndarray:
    """Distances along the road at which what bends is cut: the closer, the tighter the bend."""
    stations: list[float] = []
    for (first, a), (last, b) in zip(road.knots, road.knots[1:], strict=False):
        sharpest = max(abs(a), abs(b))
        if sharpest:
            # The sagitta of a chord c is c^2 * curvature / 8.
            count = int(np.ceil((last - first) / np.sqrt(8 * SAGITTA_M / sharpest)))
            stations.extend(np.linspace(first, last, count + 1))
    return np.unique(stations)


def cut_along(mesh: Mesh, stations: np.ndarray) -> Mesh:
    """`mesh` cut at stations along x, so that no face lies on both sides of one."""
    while len(mesh.corners) and len(stations):
        x = mesh.corners[..., 0].astype(np.float64)
        first = np.searchsorted(stations, x.min(axis=1) + 1e-3)
        last = np.searchsorted(stations, x.max(axis=1) - 1e-3)
        crosses = last > first
        if not crosses.any():
            break
        # Halving the stations that a face crosses takes as many passes as their logarithm.
        middle = stations[np.minimum((first + last) // 2, len(stations) - 1)]
        pieces = _halves(_of(mesh, crosses), middle[crosses])
        mesh = _beside(_of(mesh, ~crosses), pieces)
    return mesh


def _halves(mesh: Mesh, at: np.ndarray) -> Mesh:
    """Faces that cross x = `at` [F], cut in three there."""
    both = np.concatenate([mesh.corners, mesh.uv], axis=-1).astype(np.float64)
    before = both[..., 0] < at[:, None]
    # The corner that is alone on its side comes first; the order round the face stays.
    alone = np.where(before.sum(axis=1) == 1, before.argmax(axis=1), (~before).argmax(axis=1))
    a, b, c = (both[np.arange(len(both)), (alone + i) % 3] for i in range(3))

    def meeting(other: np.ndarray) -> np.ndarray:
        """Where the edge from the lonely corner meets the cut."""
        share = (at - a[:, 0]) / (other[:, 0] - a[:, 0])
        return a + share[:, None] * (other - a)

    ab, ac = meeting(b), meeting(c)
    faces = np.concatenate([np.stack(f, 1) for f in ((a, ab, ac), (ab, b, c), (ab, c, ac))])
    corners = faces[..., :3].astype(np.float32)
    arrays = {n: np.tile(getattr(mesh, n), 3) for n in _ARRAYS if n not in ("corners", "uv")}
    arrays |= {"corners": corners, "uv": faces[..., 3:].astype(np.float32)}
    pieces = Mesh(**arrays, kinds=mesh.kinds)
    # Where a corner lies on the cut, one of the three has no area.
    return _of(pieces, np.linalg.norm(area_vectors(corners.astype(np.float64)), axis=1) > 1e-9)


_ARRAYS = [field.name for field in fields(Mesh) if field.name != "kinds"]


def _of(mesh: Mesh, faces: np.ndarray) -> Mesh:
    """The faces of a mesh that a mask picks."""
    return Mesh(**{name: getattr(mesh, name)[faces] for name in _ARRAYS}, kinds=mesh.kinds)


def _beside(first: Mesh, second: Mesh) -> Mesh:
    """The faces of two meshes, of the kinds of the first."""
    arrays = {n: np.concatenate([getattr(first, n), getattr(second, n)]) for n in _ARRAYS}
    return Mesh(**arrays, kinds=first.kinds)
