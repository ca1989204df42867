"""Cameras on a car."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.clip_rendering import _seed
from shotenv.config.bank import BankConfig, WorldConfig
from shotenv.config.mounts import MountConfig
from shotenv.world.geometry.motion import Arc, Pose, rotation
from shotenv.world.geometry.mounting import mounted

CAR = Arc(Pose((1.0, 2.0, 0.0), 0.4, 0.1, -0.05), 5.0, 0.3)


def test_without_a_mount_the_camera_is_the_car():
    assert mounted(CAR, MountConfig()) is CAR


def test_a_camera_keeps_its_place_on_the_car():
    mount = MountConfig(position_m=(1.5, -0.6, 0.9), yaw_deg=-90.0, pitch_deg=10.0, roll_deg=3.0)
    camera = mounted(CAR, mount)
    own = rotation(Pose((0, 0, 0), *np.radians([-90.0, 10.0, 3.0])))
    for time in (0.0, 0.7):
        car, pose = CAR.at(time), camera.at(time)
        place = rotation(car).T @ np.subtract(pose.position_m, car.position_m)
        np.testing.assert_allclose(place, mount.position_m, atol=1e-12)
        np.testing.assert_allclose(rotation(car).T @ rotation(pose), own, atol=1e-12)


def test_a_world_is_a_clip_for_each_camera(sensor, tmp_path):
    cameras = (MountConfig(name="front"), MountConfig(name="left", yaw_deg=90.0))
    one = BankConfig(name="cars", sensor=sensor)
    two = one.model_copy(update={"world": WorldConfig(mounts=cameras)})
    jobs = clip_jobs(two, tmp_path)
    assert len(jobs) == 2 * len(clip_jobs(one, tmp_path))
    assert len({job.folder for job in jobs}) == len(jobs)
    front, left = jobs[:2]
    assert (front.seed, front.family, front.split) == (left.seed, left.family, left.split)
    assert [front.mount.name, left.mount.name] == ["front", "left"]
    assert math.isclose(left.mount.yaw_deg, 90.0)


def test_cameras_of_one_world_have_noise_of_their_own_and_the_first_that_of_a_lone_one(
    sensor, tmp_path
):
    cameras = (MountConfig(name="front"), MountConfig(name="left", yaw_deg=90.0))
    one = BankConfig(name="cars", sensor=sensor)
    two = one.model_copy(update={"world": WorldConfig(mounts=cameras)})
    alone, front, left = (*clip_jobs(one, tmp_path)[:1], *clip_jobs(two, tmp_path)[:2])
    seeds = [[_seed(job, number) for number in range(-1, 20)] for job in (alone, front, left)]
    assert seeds[0] == seeds[1]
    assert not set(seeds[1]) & set(seeds[2])


def test_cameras_of_the_same_name_are_refused():
    with pytest.raises(ValueError, match="mounts are named camera, camera"):
        WorldConfig(mounts=(MountConfig(), MountConfig(yaw_deg=90.0)))
