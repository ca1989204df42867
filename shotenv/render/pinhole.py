"""The camera and the laser beside it: a pinhole at the centre of projection."""

from __future__ import annotations

import math
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.backend import upload
from shotenv.render.instants import Instants
from shotenv.world.geometry import Motion, rotation


def half_extents(camera: CameraConfig) -> tuple[float, float]:
    """Tangents of half the horizontal and half the vertical field of view; square pixels."""
    across = math.tan(math.radians(camera.horizontal_fov_deg) / 2)
    return across, across * camera.height / camera.width


def field_of_view_sr(camera: CameraConfig) -> float:
    """Solid angle of the field of view, a rectangular pyramid: 4 asin(sin a sin b), sr."""
    across, down = half_extents(camera)
    return 4 * math.asin(across / math.hypot(1, across) * down / math.hypot(1, down))


class Pinhole:
    """Camera poses of all instants on the device, with the laser at the same place.

    Rays start at the centre of projection itself, so that distances are true distances.
    `intensity` is the laser's inside the field of view, W sr-1 per watt.
    """

    def __init__(self, ego: Motion, instants: Instants, camera: CameraConfig):
        poses = [ego.at(t) for t in instants.times_s]
        self._camera = camera
        self.intensity = 1 / field_of_view_sr(camera)
        self._position = upload(np.array([pose.position_m for pose in poses]))
        self._axes = upload(np.stack([rotation(pose).T for pose in poses]))

    def rays(self, lanes, jitter) -> tuple[Any, Any]:
        """Origin and direction of each lane's ray; sample 0 goes through the pixel's centre."""
        camera = self._camera
        across, down = half_extents(camera)
        # The true distance is that of sample 0, the same for every seed.
        offset = dr.select(lanes.sample == 0, 0.5, jitter)
        column = mi.Float(lanes.pixel % camera.width) + offset.x
        row = mi.Float(lanes.pixel // camera.width) + offset.y
        left = across * (1 - column * (2 / camera.width))
        up = down * (1 - row * (2 / camera.height))
        ahead, leftward, upward = self._axes_at(lanes.instant)
        direction = dr.normalize(ahead + left * leftward + up * upward)
        return self._position_at(lanes.instant), direction

    def emitted(self, sample, instant) -> tuple[Any, Any, Any]:
        """Origin and direction of a ray of the laser's light, and its density per solid angle.

        Drawn evenly over the image plane by a point `sample` of the unit square.
        """
        across, down = half_extents(self._camera)
        ahead, leftward, upward = self._axes_at(instant)
        left, up = across * (1 - 2 * sample.x), down * (1 - 2 * sample.y)
        way = ahead + left * leftward + up * upward
        length = dr.norm(way)
        per_sr = length * length * length / (4 * across * down)
        return self._position_at(instant), way / length, per_sr

    def emission_density(self, to_laser, instant):
        """Density of `emitted` per solid angle, of a ray against the direction `to_laser`."""
        across, down = half_extents(self._camera)
        ahead, leftward, upward = self._axes_at(instant)
        depth = -dr.dot(to_laser, ahead)
        inside = (dr.abs(dr.dot(to_laser, leftward)) <= across * depth) & (
            dr.abs(dr.dot(to_laser, upward)) <= down * depth
        )
        return dr.select(inside, dr.rcp(depth * depth * depth) / (4 * across * down), 0)

    def laser(self, point, instant) -> tuple[Any, Any, Any]:
        """Radiant intensity (W sr-1 per watt) towards `point`, direction from it, distance."""
        away = self._position_at(instant) - point
        distance = dr.norm(away)
        direction = away / distance
        ahead, leftward, upward = self._axes_at(instant)
        across, down = half_extents(self._camera)
        depth = -dr.dot(direction, ahead)
        # Behind the camera `depth` is negative, and nothing is inside.
        inside = (dr.abs(dr.dot(direction, leftward)) <= across * depth) & (
            dr.abs(dr.dot(direction, upward)) <= down * depth
        )
        return dr.select(inside, self.intensity, 0), direction, distance

    def _position_at(self, instant):
        return dr.gather(mi.Point3f, self._position, instant)

    def _axes_at(self, instant):
        return [dr.gather(mi.Vector3f, self._axes, 3 * instant + i) for i in range(3)]
