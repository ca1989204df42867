"""Putting things into a world so that nothing collides during a clip.

Every thing has a ground footprint, a rectangle at each instant of the clip. A thing is placed only
where its footprint stays off the ego vehicle's and off every other thing's.

A site is told along a straight road: x along it, y across. When all is placed, the site is bent
along the road as it really runs, so that layouts need not know its bends.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from copy import copy
from dataclasses import replace

import numpy as np

from shotenv.config import Family
from shotenv.world.geometry import meshes
from shotenv.world.geometry.materials import Material
from shotenv.world.geometry.model import Indoor, Lamp, Light, Mesh, MovingObject, World
from shotenv.world.geometry.motion import Motion, Pose, Route, rotation
from shotenv.world.geometry.mover import Mover, swept
from shotenv.world.geometry.road import (
    LONGEST_RIGID_M,
    STRAIGHT,
    Bent,
    BentRoute,
    Curve,
    bent_mesh,
    bent_points,
    bent_pose,
    is_own_ground,
)
from shotenv.world.geometry.weather import DRY, Weather, weathered
from unwrap.support import Range

STEP_S = 0.04
"""Time between the instants at which footprints are compared: 0.6 m at 15 m/s."""
MAX_INSTANTS = 500
"""In clips longer than 20 s footprints are compared less often: every 0.05 s of 25.6 s."""
HEADROOM_M = 2.0
"""Only what is lower than this can be run into: crowns may hang over a road."""
EGO_AHEAD_M = 0.5
"""Nothing is put closer to the camera than this along the road."""
EGO_BEHIND_M = 3.5
"""Rear of the ego vehicle, behind its camera: it swings out when a car turns or goes backwards."""
EGO_BESIDE_M = 1.1
"""Half the width of the ego vehicle, with its mirrors."""
GAP_M = 0.15
"""Between any two things, so that no faces touch."""
MAX_TRIANGLES = 8000
"""Things are left out once a stretch of the road has as many."""
STRETCH_M = 60.0
"""Length of such a stretch: about what is seen at once."""
GROUND_REACH_M = 120.0
"""How far the ground reaches beyond the road, to all sides."""


class Site:
    """A world in the making: what has been placed, and the ground that is still free.

    Parameters
    ----------
    ego : Motion
        Path of the camera, told along the road.
    duration_s : float
        Length of the clip.
    night : bool
        Lamps of streets, windows and cars are on.
    weather : Weather
        What rain and snow have done to everything that stands still.
    road : Curve
        How the road runs on which x = 0, y = 0 is the place of the ego at time 0.

    Attributes
    ----------
    travel_m : float
        How far along the road the ego gets.
    taken : list of float64 [T, 2, 2]
        Ground rectangles that are not free, of one thing each, the ego first: T is 1 for what
        stands, and the number of instants for what moves.
    """

    def __init__(
        self,
        ego: Motion,
        duration_s: float,
        night: bool = False,
        weather: Weather = DRY,
        road: Curve = STRAIGHT,
    ):
        self.ego = ego
        self.duration_s = duration_s
        self.night = night
        self.weather = weather
        self.road = road
        instants = int(np.clip(np.ceil(duration_s / STEP_S), 2, MAX_INSTANTS))
        self.times = np.linspace(0.0, duration_s, instants)
        self.static: list[Mesh] = []
        self.moving: list[MovingObject] = []
        # Whose pieces `moving` are: on a bent road each is set on its own bent route.
        self._movers: list[tuple[Mover, Route]] = []
        self.lamps: list[Lamp] = []
        self.indoor: Indoor | None = None
        self.room = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
        self.ceiling_m = np.inf
        way = [ego.at(time) for time in self.times]
        self.travel_m = max(pose.position_m[0] for pose in way)
        # The ego is the first to take ground, so that nothing can be put in its way.
        x, y = (-EGO_BEHIND_M, EGO_AHEAD_M), (-EGO_BESIDE_M, EGO_BESIDE_M)
        self.taken = [rectangles(x, y, way)]
        # Those of `taken` that stand, in one array, which is compared at once. In a list, since
        # the site's stretches share it.
        self._standing = [np.empty((0, 2, 2))]
        self._triangles: Counter[int] = Counter()
        # Beside each of `static`: where along the road it stands as a rigid thing, NaN for what
        # bends with the road, infinity for what is told in the world and stays as it is.
        self._anchors_m: list[float] = []

    def enclose(self, x: Range, y: Range, ceiling_m: float) -> None:
        """From now on keep things inside a rectangle and under a ceiling."""
        self.room, self.ceiling_m = np.array([x, y]).T, ceiling_m

    def stretches(self) -> Iterator[Site]:
        """The site as it is for what is put near the end of each stretch of the way.

        What is put by `travel_m`, such as people ahead of where the ego will be, comes once for
        each: a drive of 300 m meets as many people in a minute as one of 30 m.
        """
        count = max(1, round(self.travel_m / STRETCH_M))
        for end in self.travel_m * np.arange(1, count + 1) / count:
            # A shallow copy: what is put there is put here.
            part = copy(self)
            part.travel_m = float(end)
            yield part

    def build(self, mesh: Mesh, sheltered: bool = False, straight: bool = False) -> None:
        """Add ground, ceilings and other things that nothing can run into.

        Rain and snow leave what is `sheltered` as it is, such as the track of many wheels. What is
        `straight` is told in the world's axes and does not bend with the road.
        """
        x, y = mesh.corners[..., 0], mesh.corners[..., 1]
        under = np.array([[[x.min(), y.min()], [x.max(), y.max()]]], np.float64)
        # What bends with the road is cut off where it leaves its ground, not left out.
        bends = float(np.ptp(x)) > LONGEST_RIGID_M
        if straight or bends or self._is_own_ground(under):
            self._add(mesh if sheltered else weathered(mesh, self.weather), straight)

    def build_ground(self, material: Material, z: float = 0.0) -> None:
        """Level ground under everything, as far as one can see from anywhere on the way."""
        along = np.arange(-GROUND_REACH_M / 2, self.travel_m + GROUND_REACH_M / 2, 2.0)
        x, y, _ = self.road.at(along)
        reach = GROUND_REACH_M
        sides = [(float(v.min() - reach), float(v.max() + reach)) for v in (x, y)]
        self.build(meshes.patch(sides[0], sides[1], z, material), straight=True)

    def put(self, mesh: Mesh, x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> bool:
        """Stand a thing at (x, y) on a floor of height `z`; false if there is no room."""
        pose = Pose((x, y, z), yaw)
        points = mesh.corners.reshape(-1, 3)
        outline = np.concatenate([below(mesh.corners, HEADROOM_M), points[[points[:, 2].argmax()]]])
        free = self._claim(outline, len(mesh.corners), [pose])
        if free:
            self._add(weathered(meshes.place(mesh, pose), self.weather), counts=False)
        return free

    def put_moving(self, mover: Mover, route: Route) -> bool:
        """Add a thing that moves, its origin on the ground; false if its way is not free.

        All that its parts sweep is one footprint that moves with its body. What moves stays dry
        and bare: rain and snow lie on what stands still.
        """
        span_s = (0.0, self.duration_s)
        pieces = mover.on(route, span_s)
        faces = sum(len(piece.mesh.corners) for piece in pieces)
        outline = swept(pieces, route, span_s, HEADROOM_M)
        free = self._claim(outline, faces, [route.at(time) for time in self.times])
        if free:
            self.moving += pieces
            self._movers.append((mover, route))
        return free

    def world(self, family: Family, seed: int, light: Light) -> World:
        """The finished world, bent along its road."""
        lamps = [self._bent_lamp(lamp) for lamp in (*light.lamps, *self.lamps)]
        light = replace(light, lamps=tuple(lamps), indoor=self.indoor)
        static, moving, ego = meshes.join(self.static), tuple(self.moving), self.ego
        if self.road.knots:
            anchors = np.repeat(self._anchors_m, [len(mesh.corners) for mesh in self.static])
            static = bent_mesh(self.road, static, anchors)
            span_s = (0.0, self.duration_s)
            moving = tuple(
                piece
                for mover, route in self._movers
                for piece in mover.on(BentRoute(route, self.road, span_s), span_s)
            )
            ego = Bent(ego, self.road)
        return World(family, seed, static, moving, light, ego)

    def _bent_lamp(self, lamp: Lamp) -> Lamp:
        """A lamp where the road leads it; one that is carried is told in its carrier's axes."""
        if lamp.carrier is not None or not self.road.knots:
            return lamp
        pose = bent_pose(self.road, Pose(lamp.position_m))
        x, y, z = rotation(Pose((0.0, 0.0, 0.0), pose.yaw_rad)) @ lamp.direction
        return replace(lamp, position_m=pose.position_m, direction=(float(x), float(y), float(z)))

    def _add(self, mesh: Mesh, straight: bool = False, counts: bool = True) -> None:
        """Take a mesh, placed along the road, into the site."""
        along = mesh.corners[..., 0]
        low, high = float(along.min()), float(along.max())
        middle = (low + high) / 2
        self.static.append(mesh)
        rigid = middle if high - low <= LONGEST_RIGID_M else np.nan
        self._anchors_m.append(np.inf if straight else rigid)
        if counts:
            self._triangles[int(middle // STRETCH_M)] += len(mesh.corners)

    def _claim(self, points: np.ndarray, faces: int, poses: list[Pose]) -> bool:
        """Take the ground under points [N, 3] of a thing of so many faces; false if not free.

        The thing stands at one pose or is at one for each instant.
        """
        taken = footprints(points, poses)
        inside = (taken[:, 0] >= self.room[0]).all() and (taken[:, 1] <= self.room[1]).all()
        low_enough = poses[0].position_m[2] + points[:, 2].max() < self.ceiling_m
        stretch = int(poses[0].position_m[0] // STRETCH_M)
        affordable = self._triangles[stretch] + faces <= MAX_TRIANGLES
        if not (inside and low_enough and affordable and self._is_own_ground(taken)):
            return False
        if len(poses) == 1:
            # What stands stays straight where the road bends, and reaches off its ground for it:
            # by the sagitta of its length.
            (low, high) = taken[0, :, 0]
            off_m = (high - low) ** 2 / 8 * self.road.sharpest_between(low, high)
            taken = taken + np.array([[0.0, -off_m], [0.0, off_m]])
        if any(overlap(taken, other) for other in self.taken if len(other) > 1):
            return False
        # Of what stands, only what the whole way comes near has to be compared at each instant.
        standing = self._standing[0]
        hull = np.stack([taken[:, 0].min(axis=0), taken[:, 1].max(axis=0)])[None]
        if any(overlap(taken, standing[i : i + 1]) for i in np.flatnonzero(near(hull, standing))):
            return False
        # Whoever comes first has the ground: later things see it as taken, at each instant.
        self.taken.append(taken)
        if len(poses) == 1:
            self._standing[0] = np.concatenate([standing, taken])
        self._triangles[stretch] += faces
        return True

    def _is_own_ground(self, taken: np.ndarray) -> bool:
        """Whether all corners of footprints [T, 2, 2] are nearest to their own part of the road."""
        if not self.road.knots:
            return True
        corners = taken[:, [0, 0, 1, 1], 0], taken[:, [0, 1, 0, 1], 1]
        points = np.stack([*(c.ravel() for c in corners), np.zeros(4 * len(taken))], axis=1)
        return bool(is_own_ground(self.road, points, bent_points(self.road, points)).all())


def footprints(points: np.ndarray, poses: list[Pose]) -> np.ndarray:
    """Ground rectangles [T, 2, 2] ((low, high), (x, y)) of points [N, 3] below the headroom."""
    points = points.astype(np.float64)
    points = points[points[:, 2] <= HEADROOM_M, :2]
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return rectangles((x0, x1), (y0, y1), poses)


def rectangles(x: Range, y: Range, poses: list[Pose]) -> np.ndarray:
    """Rectangles [T, 2, 2] ((low, high), (x, y)) about a turned one, at each of T poses."""
    outline = np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])
    yaw = np.array([pose.yaw_rad for pose in poses])
    # Transposed, so that rows of points are turned: outline @ turn.
    turn = np.moveaxis(np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]), -1, 0)
    placed = outline @ turn + np.array([pose.position_m[:2] for pose in poses])[:, None]
    return np.stack([placed.min(axis=1), placed.max(axis=1)], axis=1)


def below(corners: np.ndarray, height_m: float) -> np.ndarray:
    """Points float64 [N, 3] that span what is below a height of the triangles [F, 3, 3].

    Their corners there, and where their edges cross the height: a slanting panel may have only one
    corner below it.
    """
    start = corners.astype(np.float64).reshape(-1, 3)
    end = np.roll(corners.astype(np.float64), -1, axis=1).reshape(-1, 3)
    low = start[:, 2] < height_m
    crosses = low != (end[:, 2] < height_m)
    start_z, end_z = start[crosses, 2:], end[crosses, 2:]
    share = (height_m - start_z) / (end_z - start_z)
    crossings = start[crosses] + share * (end[crosses] - start[crosses])
    crossings[:, 2] = height_m
    return np.concatenate([start[low], crossings])


def near(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Whether rectangles come closer than a gap, bool [T]; one that stands still has T = 1."""
    # Apart along either axis is apart; what stands still is compared with each instant by
    # broadcasting.
    apart = (a[:, 0] > b[:, 1] + GAP_M) | (b[:, 0] > a[:, 1] + GAP_M)
    result: np.ndarray = np.logical_not(apart.any(axis=1))
    return result


def overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two footprints come closer than a gap at any instant."""
    return bool(near(a, b).any())
