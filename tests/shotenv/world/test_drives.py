"""How the ego drives: speeds, ways, bends, the length of worlds, and what it drives through."""

import math

import numpy as np
import pytest
import trimesh
from drawn_worlds import EVERY, plain_box

from shotenv.config.bank import WorldConfig
from shotenv.config.families import FAMILIES, SHIFT_FAMILIES
from shotenv.world import ego as ego_drives
from shotenv.world.draw import draw_world
from shotenv.world.ego import ACCELERATION_M_S2, LANE_MANNERS, PARKING_MANNERS, draw_ego
from shotenv.world.families.settings import SETTINGS
from shotenv.world.geometry import materials as m, meshes
from shotenv.world.geometry.model import Lamp
from shotenv.world.geometry.motion import Arc, Pose, ground_speed_m_s, yaw_rate_rad_s
from shotenv.world.geometry.road import (
    Bent,
    Curve,
    bent_mesh,
    bent_points,
    cut_along,
    is_own_ground,
)
from shotenv.world.geometry.site import STRETCH_M, Site
from shotenv.world.geometry.speed import (
    HARDEST_JERK_M_S3,
    SpeedChange,
    SpeedProfile,
    speeds_in_turn,
)
from shotenv.world.geometry.vehicle import Body, Drive

LONG = WorldConfig(frames_per_clip=64)
BRAKE_AND_GO = speeds_in_turn(10.0, [(2.5, 0.0, 1.0), (1.5, 6.0, 2.0), (1.0, 3.0, 0.0)], -0.5)
S_BEND = Curve(((2.0, 0.0), (6.0, 0.1), (14.0, 0.1), (20.0, -0.05), (30.0, 0.0)))


def egos(count, config=LONG):
    """Drives and roads of all places, without what stands beside them."""
    for family, setting in SETTINGS.items():
        for place in setting.places:
            for seed in range(count):
                rng = np.random.default_rng([*family.encode(), seed])
                yield draw_ego(rng, place, config.frames_per_clip / config.frame_rate_hz, config)


def derivative(function, times, step=1e-4):
    return np.array([(function(t + step) - function(t - step)) / (2 * step) for t in times])


def test_speed_is_the_rate_of_the_distance_and_acceleration_that_of_the_speed():
    times = np.linspace(-2.0, 15.0, 400)
    speeds = [BRAKE_AND_GO.speed_m_s(t) for t in times]
    assert derivative(BRAKE_AND_GO.distance_m, times) == pytest.approx(speeds, abs=1e-3)
    rates = [BRAKE_AND_GO.acceleration_m_s2(t) for t in times]
    assert derivative(BRAKE_AND_GO.speed_m_s, times) == pytest.approx(rates, abs=2e-3)
    assert BRAKE_AND_GO.distance_m(0.0) == 0.0
    assert BRAKE_AND_GO.speed_m_s(-100.0) == 10.0
    assert BRAKE_AND_GO.speed_m_s(100.0) == 3.0


def test_constant_speed_goes_on_before_and_after():
    still = SpeedProfile(4.0)
    assert [still.distance_m(t) for t in (-1.0, 0.0, 2.5)] == [-4.0, 0.0, 10.0]


def test_accelerations_and_jerks_of_drives_are_bounded():
    for drive, _ in egos(12):
        profile, times = drive.profile, np.arange(-1.0, 8.0, 0.05)
        rates = np.array([profile.acceleration_m_s2(t) for t in times])
        assert np.abs(rates).max() <= ACCELERATION_M_S2[1] + 1e-6
        assert np.abs(np.diff(rates) / 0.05).max() <= HARDEST_JERK_M_S3 + 1e-6


def test_few_clips_stand_from_begin_to_end_and_many_change_their_speed():
    ways = []
    for drive, _ in egos(60):
        at = [drive.profile.distance_m(t) for t in np.linspace(0.0, 6.4, 33)]
        ways.append((np.ptp(at), np.ptp(np.diff(at))))
    way, change = np.transpose(ways)
    assert np.mean(way < 0.01) <= 0.05
    assert np.mean(change > 0.05) > 0.4
    assert sum(LANE_MANNERS.values()) == pytest.approx(1.0)
    assert sum(PARKING_MANNERS.values()) == pytest.approx(1.0)


@pytest.mark.parametrize("curvature", [0.2, -0.05])
def test_constant_curvature_is_an_arc(curvature):
    way = Curve(((-1e-9, 0.0), (0.0, curvature), (50.0, curvature)))
    drive = Drive(SpeedProfile(3.0), way, height_m=1.0)
    arc = Arc(Pose((0.0, 0.0, 1.0)), 3.0, 3.0 * curvature)
    # Curvature begins within one step of the curve's grid.
    for time in (1.0, 4.0, 9.0):
        assert drive.at(time).position_m == pytest.approx(arc.at(time).position_m, abs=0.3)
    turned = [drive.at(t).yaw_rad - drive.at(2.0).yaw_rad for t in (2.0, 5.0)]
    assert turned == pytest.approx([0.0, 9.0 * curvature], abs=1e-6)


def test_a_vehicle_moves_where_it_heads_at_the_speed_and_turn_of_its_profile():
    drive = Drive(BRAKE_AND_GO, S_BEND)
    for time in np.linspace(-0.3, 9.0, 60):
        at, later = drive.at(time - 5e-4), drive.at(time + 5e-4)
        x, y = np.subtract(later.position_m, at.position_m)[:2] / 1e-3
        heading, speed = drive.at(time).yaw_rad, BRAKE_AND_GO.speed_m_s(time)
        assert ground_speed_m_s(drive, time) == pytest.approx(speed, abs=2e-3)
        assert y * math.cos(heading) - x * math.sin(heading) == pytest.approx(0.0, abs=0.01)
        along = BRAKE_AND_GO.distance_m(time)
        bend = np.interp(along, *zip(*S_BEND.knots, strict=True), left=0.0, right=0.0)
        assert yaw_rate_rad_s(drive, time) == pytest.approx(speed * bend, abs=0.03)


def test_bank_speed_and_yaw_rate_add_up_to_the_way():
    for seed in range(6):
        world = draw_world("overcast_street", seed, LONG)
        times = np.arange(0.0, 6.4, 0.01)
        pose = world.ego.at(0.0)
        x, y, heading = *pose.position_m[:2], pose.yaw_rad
        for time in times:
            middle = time + 0.005
            step, turn = (
                0.01 * ground_speed_m_s(world.ego, middle),
                0.01 * yaw_rate_rad_s(world.ego, middle),
            )
            x, y = x + step * math.cos(heading + turn / 2), y + step * math.sin(heading + turn / 2)
            heading += turn
        there = world.ego.at(float(times[-1]) + 0.01)
        assert (x, y) == pytest.approx(there.position_m[:2], abs=0.05)
        assert heading == pytest.approx(there.yaw_rad, abs=2e-3)


def test_who_reverses_has_negative_speed_and_comes_back_where_it_was():
    there_and_back = Curve(reverse_from_m=4.0)
    # 2 m/s to a stop at 4 m, then backwards.
    profile = speeds_in_turn(2.0, [(1.5, 0.0, 1.0), (1.5, 2.0, 0.0)], 1.0)
    stop = profile.distance_m(1.0 + profile.changes[0].duration_s)
    drive = Drive(profile, Curve(reverse_from_m=stop))
    assert ground_speed_m_s(drive, 0.0) == pytest.approx(2.0)
    assert ground_speed_m_s(drive, 8.0) == pytest.approx(-2.0)
    assert drive.at(0.0).position_m[0] == pytest.approx(0.0)
    x, _, _ = there_and_back.at(np.array([3.0, 5.0, 4.0]))
    assert x == pytest.approx([3.0, 3.0, 4.0])


def test_a_car_that_reverses_turns_the_other_way():
    back = Curve(((0.0, 0.0), (1.0, 0.15), (9.0, 0.15), (10.0, 0.0)), reverse_from_m=0.0)
    x, y, heading = back.at(np.array([0.0, 8.0]))
    # The wheel to the left: backwards, the nose swings to the right and the tail to the left.
    assert heading[1] < heading[0] - 0.5
    assert x[1] < x[0] - 3.0
    assert y[1] > 0.5


def test_who_parks_is_as_fast_when_the_clip_begins_as_just_after(monkeypatch):
    """Backwards too, where the car is on its way out already."""
    begun = 0
    for manner in PARKING_MANNERS:
        monkeypatch.setattr(ego_drives, "PARKING_MANNERS", {manner: 1.0})
        for seed in range(20):
            rng = np.random.default_rng(seed)
            drive = Drive(*ego_drives.draw_parking(rng, (1.0, 4.0), (0.0, 10.0), 2.0))
            first, after = (ground_speed_m_s(drive, time) for time in (0.0, 0.02))
            assert first == pytest.approx(after, abs=0.1)
            begun += manner == "back out" and after < -0.1
    assert begun > 2


def test_braking_lowers_the_nose_and_nothing_shakes_at_rest():
    body = Body(0.007, ((2.0, 1e-3, 2e-3, 1e-3, 0.5), (11.0, 1e-3, 1e-3, 1e-3, 1.0)))
    profile = speeds_in_turn(10.0, [(2.5, 0.0, 5.0)], 1.0)
    stiff = Drive(profile, height_m=1.0, body=Body(0.007))
    braking = profile.changes[0].begin_s + profile.changes[0].duration_s / 2
    assert stiff.at(braking).pitch_rad == pytest.approx(0.007 * 2.5, rel=1e-3)
    assert stiff.at(0.0).pitch_rad == 0.0
    shaken = Drive(profile, height_m=1.0, body=body)
    rest = [shaken.at(t) for t in np.linspace(8.0, 9.0, 20)]
    assert all(pose == rest[0] for pose in rest)
    heights = [shaken.at(t).position_m[2] for t in np.linspace(0.0, 0.9, 90)]
    assert 5e-4 < np.std(heights) < 2e-3


def test_vibration_of_drives_is_some_millimetres_and_tenths_of_a_degree():
    for drive, _ in egos(4):
        heave, pitch, roll = np.transpose([drive.body.shaken(t) for t in np.arange(0, 4, 0.01)])
        assert 1e-4 < heave.std() < 1e-2
        assert pitch.std() < math.radians(0.5)
        assert roll.std() < math.radians(0.5)
        # Faster shaking than that is not of a car's body or wheels.
        assert all(1.0 <= tone[0] <= 15.0 for tone in drive.body.tones)


def test_no_bend_throws_the_ego_out():
    for drive, road in egos(10):
        bent = Bent(drive, road)
        for time in np.arange(0.0, 6.4, 0.2):
            sideways = abs(ground_speed_m_s(bent, time) * yaw_rate_rad_s(bent, time))
            # The swing within the lane adds a little to the bend's own 2.5 m/s2.
            assert sideways < 3.1


def test_bent_ground_lies_along_the_road():
    road = Curve(((0.0, 0.0), (0.01, 0.05), (25.0, 0.05), (25.01, 0.0)))
    patch = meshes.patch((-5.0, 30.0), (-2.0, 3.0), 0.0, m.Material(0.2, 0.3))
    bent = bent_mesh(road, patch, np.full(2, np.nan))
    area = np.linalg.norm(meshes.area_vectors(bent.corners.astype(float)), axis=1).sum() / 2
    # On a left bend the left side is shorter: by the turned angle times half the difference of the
    # squares of both sides.
    assert area == pytest.approx(35.0 * 5.0 - 25.0 * 0.05 * (9.0 - 4.0) / 2, rel=2e-3)
    assert np.ptp(bent.corners[..., 2]) == 0.0
    inner, middle = (bent_points(road, np.array([[15.0, y, 0.0]]))[0] for y in (3.0, 0.0))
    assert np.linalg.norm(inner - middle) == pytest.approx(3.0)


def test_cutting_keeps_area_and_texture():
    patch = meshes.patch((-5.0, 30.0), (-2.0, 3.0), 0.0, m.Material(0.2, 0.3))
    cut = cut_along(patch, np.array([0.0, 1.0, 2.5, 29.0, 40.0]))
    area = np.linalg.norm(meshes.area_vectors(cut.corners.astype(float)), axis=1).sum() / 2
    assert area == pytest.approx(35.0 * 5.0)
    low, high = cut.corners[..., 0].min(axis=1), cut.corners[..., 0].max(axis=1)
    for station in (0.0, 1.0, 2.5, 29.0):
        assert ((high <= station + 1e-5) | (low >= station - 1e-5)).all()
    assert cut.uv == pytest.approx(cut.corners[..., :2], abs=1e-5)


def test_inside_of_a_tight_bend_each_part_keeps_its_side():
    # A right angle on a radius of 4 m.
    road = Curve(((0.0, 0.0), (0.01, 0.25), (2 * math.pi, 0.25), (2 * math.pi + 0.01, 0.0)))
    points = np.array([[-10.0, 3.0, 0.0], [-10.0, 9.0, 0.0], [-3.0, 9.0, 0.0], [-3.0, -9.0, 0.0]])
    own = is_own_ground(road, points, bent_points(road, points))
    assert own.tolist() == [True, True, False, True]


def test_things_of_both_parts_of_a_corner_keep_off_each_other_and_off_the_way():
    road = Curve(((0.0, 0.0), (0.01, 0.25), (2 * math.pi, 0.25), (2 * math.pi + 0.01, 0.0)))
    site = Site(Arc(Pose((-20.0, 0.0, 1.0)), 10.0), 4.0, road=road)
    for x in np.arange(-20.0, 25.0, 1.3):
        site.put(plain_box(), x, 4.5)
    world = site.world("garage", 0, SETTINGS["garage"].light(np.random.default_rng(0)))
    assert len(site.static) > 15
    way = np.array([world.ego.at(t).position_m for t in np.linspace(0.0, 4.0, 200)])
    centres = world.static.corners.reshape(len(site.static), -1, 3).mean(axis=1)
    assert np.linalg.norm(centres[:, None, :2] - way[:, :2], axis=2).min() > 3.0
    apart = np.linalg.norm(centres[:, None] - centres, axis=2) + 9.0 * np.eye(len(centres))
    assert apart.min() > 1.0


def test_stretches_put_things_all_along_a_long_drive():
    site = Site(Arc(Pose((0.0, 0.0, 1.0)), 15.0), 25.6)
    ends = [part.travel_m for part in site.stretches()]
    assert ends[-1] == site.travel_m == pytest.approx(384.0)
    assert np.diff([0.0, *ends]) == pytest.approx(384.0 / len(ends))
    assert 0.75 * STRETCH_M < ends[0] < 1.5 * STRETCH_M
    part = next(site.stretches())
    assert part.put(plain_box(), 10.0, 4.0)
    assert not site.put(plain_box(), 10.0, 4.0)


@pytest.fixture(scope="module")
def long_worlds():
    return [draw_world(family, seed, LONG) for family in EVERY for seed in (2, 3, 11, 18)]


def test_nothing_runs_into_the_ego_in_long_clips(long_worlds):
    for world in long_worlds:
        for time in np.arange(0.0, 6.4, 0.4):
            placed = [meshes.place(t.mesh, t.motion.at(time)) for t in world.moving]
            corners = np.concatenate([world.static.corners, *(mesh.corners for mesh in placed)])
            camera = np.array(world.ego.at(time).position_m)
            outside = np.maximum(corners.min(axis=1) - camera, camera - corners.max(axis=1))
            close = corners[(outside < 1.0).all(axis=1)].astype(float)
            nearest = trimesh.triangles.closest_point(close, np.tile(camera, (len(close), 1)))
            assert np.linalg.norm(nearest - camera, axis=1).min(initial=np.inf) > 0.4, (
                world.family,
                world.seed,
            )


def test_some_drives_go_into_and_out_of_tunnels_garages_and_halls():
    passed = set()
    for family, seeds in (("tunnel", range(10)), ("garage", range(24)), ("warehouse", range(8))):
        for seed in seeds:
            world = draw_world(family, seed, LONG)
            ends = [is_inside(world, time) for time in (0.0, 6.4)]
            passed.add((family, *ends))
    assert {("tunnel", False, True), ("tunnel", True, False)} <= passed
    assert {("garage", False, True), ("garage", True, False)} <= passed
    assert ("warehouse", True, False) in passed


def is_inside(world, time):
    place, box = np.array(world.ego.at(time).position_m), world.light.indoor
    return bool((place > box.low).all() and (place < box.high).all())


def test_night_falls_and_lamps_come_on_in_some_clips():
    worlds = [draw_world("night_road", seed, LONG) for seed in range(24)]
    dusks = [world.light for world in worlds if world.light.fading_per_s]
    assert 1 <= len(dusks) <= 9
    for light in dusks:
        assert light.sky_zenith > 4 * light.at(6.4).sky_zenith > 1e-5
        street = {lamp.on_s for lamp in light.lamps if lamp.carrier is None and not lamp.rides}
        # All of a street at once, within the clip.
        assert len(street) <= 1
        assert all(0.0 < on_s < 6.4 for on_s in street)
    assert any(lamp.on_s > 0 for light in dusks for lamp in light.lamps)
    lamp = Lamp((0.0, 0.0, 5.0), 1.0, on_s=2.0)
    assert [lamp.share_on(t) for t in (1.9, 2.4, 3.0)] == pytest.approx([0.0, 0.5, 1.0])
    assert Lamp((0.0, 0.0, 5.0), 1.0).share_on(-1.0) == 1.0


@pytest.mark.parametrize("family", FAMILIES + SHIFT_FAMILIES)
def test_a_world_goes_on_where_a_drive_of_384_m_ends(family):
    config = WorldConfig(frames_per_clip=256, speed_m_s=(14.99, 15.0))
    world = draw_world(family, 1, config)
    end = world.ego.at(25.6)
    assert np.linalg.norm(end.position_m) > 100.0
    ahead = np.array([math.cos(end.yaw_rad), math.sin(end.yaw_rad)])
    corners = world.static.corners.astype(float)
    away = (corners.mean(axis=1)[:, :2] - end.position_m[:2]) @ ahead
    # Furnished as the begin is: a garage ends at a wall soon, a road goes on.
    assert ((away > 0.0) & (away < 60.0)).sum() > 150
    if family not in ("garage", "warehouse"):
        low = (corners[..., 2] < 0.2).all(axis=1)
        reach = (corners[low][..., :2] - end.position_m[:2]) @ ahead
        assert reach.max() > 100.0
    # Nobody drives faster than a car can turn, but this was asked for.
    speeds = [ground_speed_m_s(world.ego, t) for t in np.arange(0.0, 25.6, 0.8)]
    assert np.mean(speeds) * 25.6 == pytest.approx(384.0, rel=0.02)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: SpeedProfile(61.0), "speed_m_s is 61; expected at most 60"),
        (lambda: SpeedProfile(math.nan), "speed_m_s is nan"),
        (lambda: SpeedProfile(1.0, (SpeedChange(0.0, 0.0, 2.0),)), "duration_s is 0"),
        (
            lambda: SpeedProfile(1.0, (SpeedChange(0.0, 2.0, 2.0), SpeedChange(1.0, 1.0, 3.0))),
            "begin_s is 1; expected at least 2",
        ),
        (lambda: WorldConfig(speed_m_s=(0.0, 61.0)), "speed_m_s is .0, 61.; expected speeds"),
        (lambda: WorldConfig(speed_m_s=(-1.0, 5.0)), "speed_m_s is .-1, 5.; expected speeds"),
    ],
)
def test_bad_speeds_are_named(make, named):
    with pytest.raises(ValueError, match=named):
        make()
