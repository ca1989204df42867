"""Cameras that are fixed to a car."""

from __future__ import annotations

import math
from dataclasses import dataclass

from shotenv.config import MountConfig
from shotenv.world.geometry.motion import Motion, Pose, pose_of, rotation


@dataclass(frozen=True)
class Mounted:
    """The way of a camera at `place` on a car, in the car's own axes."""

    car: Motion
    place: Pose

    def at(self, time_s: float) -> Pose:
        """Pose of the camera at `time_s`."""
        car = self.car.at(time_s)
        turn = rotation(car)
        x, y, z = (turn @ self.place.position_m + car.position_m).tolist()
        return pose_of(turn @ rotation(self.place), (x, y, z))


def mounted(car: Motion, mount: MountConfig) -> Motion:
    """The way of the camera that `mount` fixes to a car; the car's own where they coincide."""
    angles = (math.radians(a) for a in (mount.yaw_deg, mount.pitch_deg, mount.roll_deg))
    place = Pose(mount.position_m, *angles)
    # Through a matrix and back, angles would come out rounded.
    return car if place == Pose((0.0, 0.0, 0.0)) else Mounted(car, place)
