"""The camera and the laser beside it: a pinhole at the centre of projection."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from shotenv.config import CameraConfig
from shotenv.render.backend import upload
from shotenv.render.beam import Beam, draw_directions
from shotenv.render.instants import Instants
from shotenv.world.geometry import Motion, rotation


class Pinhole:
    """Camera poses of all instants on the device, with the laser at the same place.

    Rays start at the centre of projection itself, so that distances are true distances.
    """

    def __init__(self, ego: Motion, instants: Instants, camera: CameraConfig):
        poses = [ego.at(t) for t in instants.times_s]
        self._camera = camera
        self._beam = Beam(camera)
        self._position = upload(np.array([pose.position_m for pose in poses]))
        self._axes = upload(np.stack([rotation(pose).T for pose in poses]))

    def rays(self, lanes, offset) -> tuple[Any, Any]:
        """Origin and direction of each lane's ray, through a point `offset` of its pixel."""
        camera = self._camera
        across, down = camera.half_extents
        column = mi.Float(lanes.pixel % camera.width) + offset.x
        row = mi.Float(lanes.pixel // camera.width) + offset.y
        left = across * (1 - column * (2 / camera.width))
        up = down * (1 - row * (2 / camera.height))
        ahead, leftward, upward = self._axes_at(lanes.instant)
        direction = dr.normalize(ahead + left * leftward + up * upward)
        return self.position(lanes.instant), direction

    def emitted(self, points: np.ndarray, index, instant) -> tuple[Any, Any, Any]:
        """Origin and direction of rays of the laser's light, and their density per solid angle.

        `points` [N, 2] of the unit square are drawn from, `index` says which of them a lane takes.
        """
        drawn = draw_directions(self._camera, points)
        along, left, up = dr.gather(mi.Vector3f, upload(drawn.axes), index)
        ahead, leftward, upward = self._axes_at(instant)
        direction = along * ahead + left * leftward + up * upward
        return self.position(instant), direction, dr.gather(mi.Float, upload(drawn.per_sr), index)

    def intensity(self, direction, instant):
        """Radiant intensity of the laser along a unit direction, W sr-1 per watt."""
        axes = (dr.dot(direction, axis) for axis in self._axes_at(instant))
        return self._beam.intensity(*axes)

    def laser(self, point, instant) -> tuple[Any, Any, Any]:
        """Radiant intensity (W sr-1 per watt) towards `point`, direction from it, distance."""
        away = self.position(instant) - point
        distance = dr.norm(away)
        direction = away / distance
        return self.intensity(-direction, instant), direction, distance

    def position(self, instant):
        """Where camera and laser are."""
        return dr.gather(mi.Point3f, self._position, instant)

    def _axes_at(self, instant):
        return [dr.gather(mi.Vector3f, self._axes, 3 * instant + i) for i in range(3)]
