"""Putting things into a world so that nothing collides during a clip.

Every thing has a ground footprint, an axis-aligned rectangle at each instant of the clip. A thing
is placed only where its footprint stays off the ego vehicle's and off every other thing's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shotenv.config import Family
from shotenv.world.geometry import meshes
from shotenv.world.geometry.model import (
    MAX_LAMPS,
    Indoor,
    Lamp,
    Light,
    Mesh,
    MovingObject,
    World,
)
from shotenv.world.geometry.motion import Motion, Pose
from shotenv.world.geometry.weather import DRY, Weather, weathered
from unwrap.support import Range

STEP_S = 0.04
"""Time between the instants at which footprints are compared: 0.6 m at 15 m/s."""
MAX_INSTANTS = 500
"""Longer clips than 20 s, which are driven more slowly, are compared less often."""
HEADROOM_M = 2.0
"""Only what is lower than this can be run into: crowns may hang over a road."""
EGO_AHEAD_M = 0.5
"""Nothing is put closer to the camera than this along the road."""
EGO_BESIDE_M = 1.1
"""Half the width of the ego vehicle, with its mirrors."""
GAP_M = 0.15
"""Between any two things, so that no faces touch."""
MAX_TRIANGLES = 6000
"""Things are left out once a world has as many: what moves is posed and built for every frame."""


class Site:
    """A world in the making: what has been placed, and the ground that is still free.

    Parameters
    ----------
    ego : Motion
        Path of the camera.
    duration_s : float
        Length of the clip.
    night : bool
        Lamps of streets, windows and cars are on.
    weather : Weather
        What rain and snow have done to everything that stands still.
    """

    def __init__(self, ego: Motion, duration_s: float, night: bool = False, weather: Weather = DRY):
        self.ego = ego
        self.duration_s = duration_s
        self.night = night
        self.weather = weather
        instants = int(np.clip(np.ceil(duration_s / STEP_S), 2, MAX_INSTANTS))
        self.times = np.linspace(0.0, duration_s, instants)
        self.static: list[Mesh] = []
        self.moving: list[MovingObject] = []
        self.lamps: list[Lamp] = []
        self.indoor: Indoor | None = None
        self.room = np.array([[-np.inf, -np.inf], [np.inf, np.inf]])
        self.ceiling_m = np.inf
        way = np.array([ego.at(time).position_m[:2] for time in self.times])
        self.travel_m = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        # The ego is the first to take ground, so that nothing can be put in its way.
        margin = np.array([EGO_AHEAD_M, EGO_BESIDE_M])
        self._taken = [np.stack([way - margin, way + margin], axis=1)]
        self._triangles = 0

    def enclose(self, x: Range, y: Range, ceiling_m: float) -> None:
        """From now on keep things inside a rectangle and under a ceiling."""
        self.room, self.ceiling_m = np.array([x, y]).T, ceiling_m

    def build(self, mesh: Mesh, sheltered: bool = False) -> None:
        """Add ground, ceilings and other things that nothing can run into.

        Rain and snow leave what is `sheltered` as it is, such as the track of many wheels.
        """
        self._triangles += len(mesh.corners)
        self.static.append(mesh if sheltered else weathered(mesh, self.weather))

    def put(self, mesh: Mesh, x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> bool:
        """Stand a thing at (x, y) on a floor of height `z`; false if there is no room."""
        pose = Pose((x, y, z), yaw)
        free = self._claim(mesh, [pose])
        if free:
            self.static.append(weathered(meshes.place(mesh, pose), self.weather))
        return free

    def put_moving(self, mesh: Mesh, motion: Motion) -> bool:
        """Add a thing that moves on its lowest point; false if its way is not free.

        What moves stays dry and bare: rain and snow lie on what stands still.
        """
        mesh = meshes.grounded(mesh)
        free = self._claim(mesh, [motion.at(time) for time in self.times])
        if free:
            self.moving.append(MovingObject(mesh, motion))
        return free

    def world(self, family: Family, seed: int, light: Light) -> World:
        """The finished world; the nearest lamps are kept if there are too many."""
        nearest = sorted((*light.lamps, *self.lamps), key=self._lamp_order)
        light = replace(light, lamps=tuple(nearest[:MAX_LAMPS]), indoor=self.indoor)
        return World(family, seed, meshes.join(self.static), tuple(self.moving), light, self.ego)

    def _lamp_order(self, lamp: Lamp) -> tuple[bool, float]:
        """Lamps that ride with the camera first, then by distance halfway through the clip."""
        place = lamp.position_m
        if lamp.carrier is not None:
            place = self.moving[lamp.carrier].motion.at(self.duration_s / 2).position_m
        # The camera looks ahead: lamps a little before it light more of what it sees.
        away = np.subtract(place, (self.travel_m / 2 + 4.0, 0.0, 0.0))
        return not lamp.rides, float(np.linalg.norm(away))

    def _claim(self, mesh: Mesh, poses: list[Pose]) -> bool:
        """Take the ground under a thing at one pose, or at one per instant; false if not free."""
        taken = footprints(mesh, poses)
        inside = (taken[:, 0] >= self.room[0]).all() and (taken[:, 1] <= self.room[1]).all()
        low_enough = poses[0].position_m[2] + mesh.corners[..., 2].max() < self.ceiling_m
        affordable = self._triangles + len(mesh.corners) <= MAX_TRIANGLES
        if not (inside and low_enough and affordable):
            return False
        if any(overlap(taken, other) for other in self._taken):
            return False
        # Whoever comes first has the ground: later things see it as taken, at each instant.
        self._taken.append(taken)
        self._triangles += len(mesh.corners)
        return True


def footprints(mesh: Mesh, poses: list[Pose]) -> np.ndarray:
    """Ground rectangles [T, 2, 2] ((low, high), (x, y)) of what is below the headroom."""
    points = below(mesh.corners.astype(np.float64), HEADROOM_M)[:, :2]
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    outline = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    yaw = np.array([pose.yaw_rad for pose in poses])
    # Transposed, so that rows of points are turned: outline @ turn.
    turn = np.moveaxis(np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]]), -1, 0)
    placed = outline @ turn + np.array([pose.position_m[:2] for pose in poses])[:, None]
    return np.stack([placed.min(axis=1), placed.max(axis=1)], axis=1)


def below(corners: np.ndarray, height_m: float) -> np.ndarray:
    """Points [N, 3] that span what is below a height of the triangles [F, 3, 3].

    Their corners there, and where their edges cross the height: a slanting panel may have only one
    corner below it.
    """
    start, end = corners.reshape(-1, 3), np.roll(corners, -1, axis=1).reshape(-1, 3)
    low = start[:, 2] < height_m
    crosses = low != (end[:, 2] < height_m)
    start_z, end_z = start[crosses, 2:], end[crosses, 2:]
    share = (height_m - start_z) / (end_z - start_z)
    return np.concatenate([start[low], start[crosses] + share * (end[crosses] - start[crosses])])


def overlap(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether two footprints come closer than a gap at any instant; static ones have T = 1."""
    # Rectangles are apart if they are so along either axis; one that stands still is compared with
    # each instant of the other by broadcasting.
    apart = (a[:, 0] > b[:, 1] + GAP_M) | (b[:, 0] > a[:, 1] + GAP_M)
    return bool((~apart.any(axis=1)).any())
