"""Worlds: the same from the same arguments, physical, free of collisions, near field."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from drawn_worlds import (
    CLIP,
    EVERY,
    SPARSE,
    arrays_of,
    drawn_worlds,
    movers_of,
    plain_box,
    route_of,
)

from shotenv.config.bank import WorldConfig
from shotenv.config.families import FAMILIES
from shotenv.world.draw import draw_world
from shotenv.world.geometry import lights, materials as m, meshes
from shotenv.world.geometry.motion import Arc, Pose, ground_speed_m_s
from shotenv.world.geometry.mover import Mover, Rigid, posed
from shotenv.world.geometry.site import MAX_TRIANGLES, STRETCH_M, Site, below, footprints

UNAMBIGUOUS_M = 6.2457


@pytest.fixture(scope="module")
def drawn():
    return drawn_worlds()


def duration_s(config):
    return config.frames_per_clip / config.frame_rate_hz


def corners_at(world, time_s):
    placed = [posed(thing.mesh, thing.motion.at(time_s)) for thing in world.moving]
    return np.concatenate([world.static.corners, *(mesh.corners for mesh in placed)])


def cast(corners, origin, directions):
    """Distances [N, F] along rays to triangles (Moeller-Trumbore), infinite where missed."""
    a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
    u, v, away = b - a, c - a, origin - a
    q = np.cross(away, u)
    determinant = directions @ np.cross(v, u).T
    # A parallel ray gets distance 0, which is no hit.
    inverse = np.where(np.abs(determinant) > 1e-12, 1.0 / np.where(determinant, determinant, 1), 0)
    s, t = directions @ np.cross(v, away).T * inverse, directions @ q.T * inverse
    distance = (q * v).sum(-1) * inverse
    hit = (s >= 0) & (t >= 0) & (s + t <= 1) & (distance > 1e-6)
    return np.where(hit, distance, np.inf)


def view(pose, columns=12, rows=9):
    """Directions of a coarse grid of camera rays, 60 degrees across."""
    half = np.tan(np.radians(30.0))
    y, z = np.meshgrid(np.linspace(half, -half, columns), np.linspace(half, -half, rows) * 0.75)
    level = np.stack([np.ones_like(y), y, z], -1).reshape(-1, 3)
    cos, sin = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    turned = level @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


@pytest.fixture(scope="module")
def views(drawn):
    """The two nearest distances along coarse camera rays at both ends of the dense clips."""
    result = {family: [] for family in EVERY}
    for world in (world for config, world in drawn if config is CLIP):
        for time in (0.0, duration_s(CLIP)):
            pose = world.ego.at(time)
            hits = cast(corners_at(world, time), np.array(pose.position_m), view(pose))
            result[world.family].append(np.partition(hits, 1, axis=1)[:, :2])
    return {family: np.array(hits) for family, hits in result.items()}


def digest(world):
    """Every number of a world, hashed."""
    parts = [world.static, *(thing.mesh for thing in world.moving)]
    arrays = [array.tobytes() for mesh in parts for array in arrays_of(mesh)]
    poses = [thing.motion.at(time) for thing in world.moving for time in (-0.2, 0.0, 0.7, 1.9)]
    rest = repr((sorted(world.kinds), world.light, world.ego, poses)).encode()
    return hashlib.sha256(b"".join([*arrays, rest])).hexdigest()


def all_digests():
    return " ".join(digest(draw_world(family, 3, CLIP)) for family in EVERY)


@pytest.fixture(scope="module")
def digests():
    return all_digests()


def test_same_arguments_same_world(digests):
    assert all_digests() == digests


def test_same_world_in_a_process_with_another_hash_seed(digests):
    told = subprocess.run(
        [sys.executable, "-c", "import test_world; print(test_world.all_digests())"],
        cwd=Path(__file__).parent,
        env={**os.environ, "PYTHONHASHSEED": "7", "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.strip() == digests


def test_seeds_families_and_clips_differ(drawn):
    # Where the ego stands still, clips of different length may be of the same world.
    for wanted in (CLIP, SPARSE):
        digests = [digest(world) for config, world in drawn if config is wanted]
        assert len(set(digests)) == len(digests)


def test_numbers_are_finite_and_in_range(drawn):
    for _, world in drawn:
        for mesh in (world.static, *(thing.mesh for thing in world.moving)):
            for array in arrays_of(mesh):
                assert array.dtype == np.float32
                assert np.isfinite(array).all()
            assert (mesh.albedo_low >= 0).all()
            assert (mesh.albedo_low <= mesh.albedo_high).all()
            assert (mesh.albedo_high <= 1).all()
            assert (mesh.retro >= 0).all()
            assert (mesh.retro <= 1000).all()
            assert (mesh.emission >= 0).all()
            assert (mesh.emission <= lights.BRIGHTEST_FACE).all()


def test_light_is_physical(drawn):
    for _, world in drawn:
        light = world.light
        assert np.linalg.norm(light.sun_direction) == pytest.approx(1.0, abs=1e-9)
        assert 0 <= light.sun_irradiance <= lights.G173_IRRADIANCE
        assert light.sun_direction[2] >= np.sin(np.radians(2.5)) - 1e-9
        for lamp in light.lamps:
            assert lamp.intensity_w_sr > 0
            assert np.linalg.norm(lamp.direction) == pytest.approx(1.0, abs=1e-3)


def test_families_have_their_light(drawn):
    for _, world in drawn:
        light = world.light
        if world.family in ("sunny_road", "overcast_street", "garage", "warehouse", "night_road"):
            assert (light.sun_irradiance > 0) == (world.family == "sunny_road")
        if world.family == "night_road":
            # At dusk it is brighter at first.
            assert light.sky_zenith < (0.1 if light.fading_per_s else 1e-3)
        if world.family in ("garage", "tunnel", "night_road", "warehouse"):
            assert light.lamps


def test_sun_falls_with_elevation():
    elevations = np.radians([2.0, 15.0, 25.0, 41.8])
    irradiance = [lights.sun_irradiance(e) for e in elevations]
    assert irradiance == sorted(irradiance)
    assert irradiance[-1] == pytest.approx(lights.G173_IRRADIANCE, rel=1e-3)


def test_triangle_budget_of_a_stretch():
    site = Site(Arc(Pose((0.0, 0.0, 1.0)), 10.0), 12.0)
    post = meshes.join([plain_box((0.1, 0.1, 1.0))] * 40)
    for x in np.arange(0.5, 120.0, 0.5):
        site.put(post, x, 3.0)
    stands = np.array([mesh.corners[..., 0].mean() for mesh in site.static])
    for first in (0.0, STRETCH_M):
        count = ((stands >= first) & (stands < first + STRETCH_M)).sum()
        # One more would have gone over it.
        assert MAX_TRIANGLES - len(post.corners) < count * len(post.corners) <= MAX_TRIANGLES


def test_speed_is_within_the_configuration(drawn):
    worlds = [*drawn]
    for limits in ((12.0, 13.0), (0.0, 1.0)):
        config = WorldConfig(speed_m_s=limits)
        worlds += [(config, draw_world(family, 0, config)) for family in EVERY]
    for config, world in worlds:
        for time in np.linspace(0.0, duration_s(config), 9):
            speed = abs(ground_speed_m_s(world.ego, time))
            # Within a lane the ego swings aside, on which it goes a per mille faster.
            assert config.speed_m_s[0] * 0.99 <= speed <= config.speed_m_s[1] * 1.01


def test_nothing_comes_near_the_camera(drawn):
    for config, world in drawn:
        for time in np.linspace(0.0, duration_s(config), 7):
            corners = corners_at(world, time).astype(np.float64)
            camera = np.array(world.ego.at(time).position_m)
            outside = np.maximum(corners.min(axis=1) - camera, camera - corners.max(axis=1))
            close = corners[(outside < 1.0).all(axis=1)]
            nearest = trimesh.triangles.closest_point(close, np.tile(camera, (len(close), 1)))
            assert np.linalg.norm(nearest - camera, axis=1).min(initial=np.inf) > 0.4


def test_camera_is_at_the_height_of_a_car(drawn):
    for _, world in drawn:
        # Vibration adds some millimetres.
        assert 0.58 <= world.ego.at(0.0).position_m[2] <= 1.22


def test_most_worlds_have_something_moving(drawn):
    def goes(motion, until_s):
        ways = [motion.at(time).position_m[:2] for time in np.linspace(0.0, until_s, 5)]
        return np.ptp(ways, axis=0).max() > 0.2

    moving = [
        any(goes(thing.motion, duration_s(config)) for thing in world.moving)
        for config, world in drawn
    ]
    assert np.mean(moving) > 0.7


def test_moving_things_stand_on_the_ground(drawn):
    for config, world in drawn:
        for movers in movers_of(world):
            route = route_of(movers[0].motion)
            for time in (0.0, duration_s(config)):
                placed = [posed(piece.mesh, piece.motion.at(time)) for piece in movers]
                lowest = min(float(mesh.corners[..., 2].min()) for mesh in placed)
                above = np.add(route.at(time).position_m, (0.0, 0.0, 0.05))
                fall = cast(world.static.corners, above, np.array([[0.0, 0.0, -1.0]])).min()
                assert fall == pytest.approx(0.05, abs=0.015)
                # Who runs may be in the air.
                assert -0.03 < lowest - (above[2] - fall) < 0.2


def test_no_two_faces_fight_for_the_same_place(views):
    for hits in views.values():
        seen = np.isfinite(hits[..., 1])
        apart = np.where(seen, hits[..., 1], 1.0) - np.where(seen, hits[..., 0], 0.0)
        # Rays through an edge meet both its faces at one distance; those are few.
        assert np.mean(apart < 1e-3) < 0.01


def test_every_wrap_count_is_seen(views):
    for family, hits in views.items():
        wraps = np.floor(np.minimum(hits[..., 0], 1e3) / UNAMBIGUOUS_M)
        for wrap in range(4):
            # Halls seldom have 19 m of free sight.
            seldom = family in ("garage", "warehouse")
            assert np.mean(wraps == wrap) > (0.0 if seldom else 0.01), (family, wrap)


def test_a_third_of_the_clips_are_near_field(views):
    training = [hits for family in FAMILIES for hits in views[family]]
    near = [np.mean((hits[:, 0] > 0.5) & (hits[:, 0] < 6.0)) for hits in training]
    assert np.mean(np.array(near) > 0.45) > 1 / 3


def test_first_distances_are_far_and_near(views):
    distance = np.concatenate([hits[..., 0].ravel() for hits in views.values()])
    scored = distance[distance < 25.0]
    share, _ = np.histogram(scored, bins=[0.5, 1.5, 3.0, 6.0, 9.0, 12.0, 16.0, 20.0, 25.0])
    assert (share / len(scored) > 0.005).all(), share


@pytest.mark.parametrize("rate", [0.0, 0.3, -1.2])
def test_motion_is_the_closed_form_of_an_arc(rate):
    start, speed, time = Pose((1.0, -2.0, 0.5), 0.4, 0.1), 7.0, 2.3
    pose = Arc(start, speed, rate).at(time)
    if rate:
        radius = speed / rate
        x = 1.0 + radius * (np.sin(0.4 + rate * time) - np.sin(0.4))
        y = -2.0 - radius * (np.cos(0.4 + rate * time) - np.cos(0.4))
    else:
        x, y = 1.0 + speed * time * np.cos(0.4), -2.0 + speed * time * np.sin(0.4)
    assert pose.position_m == pytest.approx((x, y, 0.5), abs=1e-9)
    assert pose.yaw_rad == pytest.approx(0.4 + rate * time)
    assert pose.pitch_rad == 0.1


def test_site_keeps_the_way_and_the_ground_free():
    site = Site(Arc(Pose((0.0, 0.0, 1.0)), 10.0), 1.0)
    assert not site.put(plain_box(), 5.0, 0.0)
    assert site.put(plain_box(), 5.0, 3.0)
    assert not site.put(plain_box(), 5.5, 3.5)
    box = Mover((Rigid(plain_box()),))
    assert not site.put_moving(box, Arc(Pose((5.0, -6.0, 0.0), np.pi / 2), 12.0))
    assert site.put_moving(box, Arc(Pose((5.0, -6.0, 0.0), -np.pi / 2), 12.0))
    assert len(site.static) == 1
    assert len(site.moving) == 1


def test_a_slanting_panel_takes_the_ground_below_all_of_it_that_is_low():
    """Of its four corners only those at the foot are lower than the headroom of 2 m."""
    corners = [(0.0, -1.0, 0.0), (3.0, -1.0, 4.0), (3.0, 1.0, 4.0), (0.0, 1.0, 0.0)]
    panel = meshes.polygon(corners, m.Material(0.2, 0.3))
    taken = footprints(below(panel.corners, 2.0), [Pose((0.0, 0.0, 0.0))])
    assert taken[0].tolist() == [[0.0, -1.0], [1.5, 1.0]]


def test_site_lets_crowns_hang_over_and_rooms_end():
    site = Site(Arc(Pose((0.0, 0.0, 1.0)), 0.0), 1.0)
    post = meshes.join(
        [plain_box((0.2, 0.2, 3.0)), meshes.at(plain_box((4.0, 4.0, 1.0)), 0.0, 0.0, 3.0)]
    )
    assert site.put(post, 2.0, 0.0)
    assert site.put(plain_box(), 3.0, 0.0)
    site.enclose((-10.0, 8.0), (-3.0, 3.0), 2.5)
    assert not site.put(plain_box(), 8.0, 0.0)
    assert not site.put(plain_box((1.0, 1.0, 2.6)), 5.0, 2.0)
    assert site.put(plain_box(), 5.0, 2.0)


@pytest.mark.parametrize(
    ("family", "seed", "config", "named"),
    [
        ("moon", 0, CLIP, "family is 'moon'"),
        ("garage", -1, CLIP, "seed is -1"),
        ("garage", 0, WorldConfig(speed_m_s=(10, 15), frames_per_clip=2048), "speed_m_s"),
    ],
)
def test_bad_arguments_are_named(family, seed, config, named):
    with pytest.raises(ValueError, match=named):
        draw_world(family, seed, config)
