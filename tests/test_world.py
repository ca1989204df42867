import hashlib
import os
import subprocess
import sys
from collections import Counter
from functools import partial
from inspect import signature
from pathlib import Path

import numpy as np
import pytest
import trimesh

from shotenv.config import (
    FAMILIES,
    SHIFT_FAMILIES,
    SensorConfig,
    WorldConfig,
    find_config,
    read_config,
)
from shotenv.sensor.gray import electrons_per_radiance_second
from shotenv.world import (
    buildings,
    construction,
    cycles,
    draw_world,
    forest,
    furniture,
    heavy,
    lights,
    meshes,
    people,
    plants,
    shelters,
    snow,
    vehicles,
    warehouse,
    weather,
)
from shotenv.world import materials as m
from shotenv.world.draw import SETTINGS
from shotenv.world.model import MAX_LAMPS, Mesh, Motion, Pose
from shotenv.world.site import MAX_TRIANGLES, Site

CLIP = WorldConfig()
SPARSE = WorldConfig(frames_per_clip=3, frame_rate_hz=1.0)
UNAMBIGUOUS_M = 6.2457
EVERY = FAMILIES + SHIFT_FAMILIES


@pytest.fixture(scope="module")
def drawn():
    """Worlds of every family for two kinds of clip: (config, world) pairs."""
    return [
        (config, draw_world(family, seed, config))
        for config in (CLIP, SPARSE)
        for family in EVERY
        for seed in range(100, 106 if config is CLIP else 103)
    ]


def duration_s(config):
    return config.frames_per_clip / config.frame_rate_hz


def corners_at(world, time_s):
    placed = [meshes.place(thing.mesh, thing.motion.at(time_s)) for thing in world.moving]
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


def view(pose, columns=16, rows=12):
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


def numbers(mesh):
    """Every array of a mesh."""
    return [value for value in vars(mesh).values() if isinstance(value, np.ndarray)]


def digest(world):
    """Every number of a world, hashed."""
    parts = [world.static, *(thing.mesh for thing in world.moving)]
    arrays = [array.tobytes() for mesh in parts for array in numbers(mesh)]
    rest = repr(
        (sorted(world.kinds), world.light, world.ego, [thing.motion for thing in world.moving])
    ).encode()
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
        env={**os.environ, "PYTHONHASHSEED": "7"},
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
            for array in numbers(mesh):
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
        assert len(light.lamps) <= MAX_LAMPS
        for lamp in light.lamps:
            assert lamp.intensity_w_sr > 0
            assert np.linalg.norm(lamp.direction) == pytest.approx(1.0, abs=1e-3)


def test_families_have_their_light(drawn):
    for _, world in drawn:
        light = world.light
        if world.family in ("sunny_road", "overcast_street", "garage", "warehouse", "night_road"):
            assert (light.sun_irradiance > 0) == (world.family == "sunny_road")
        if world.family == "night_road":
            assert light.sky_zenith < 1e-3
        if world.family in ("garage", "tunnel", "night_road", "warehouse"):
            assert light.lamps


def test_sun_falls_with_elevation():
    elevations = np.radians([2.0, 15.0, 25.0, 41.8])
    irradiance = [lights.sun_irradiance(e) for e in elevations]
    assert irradiance == sorted(irradiance)
    assert irradiance[-1] == pytest.approx(lights.G173_IRRADIANCE, rel=1e-3)


def test_triangle_budget(drawn):
    for _, world in drawn:
        # Ground and other things that are built rather than placed may go a little over it.
        assert len(corners_at(world, 0.0)) <= MAX_TRIANGLES + 300


def test_speed_is_within_the_configuration(drawn):
    for config, world in drawn:
        assert config.speed_m_s[0] <= world.ego.speed_m_s <= config.speed_m_s[1]
    fast = draw_world("garage", 0, WorldConfig(speed_m_s=(12.0, 13.0)))
    assert 12.0 <= fast.ego.speed_m_s <= 13.0


def test_long_clips_stay_in_their_world():
    config = WorldConfig(frames_per_clip=256)
    for family in EVERY:
        world = draw_world(family, 1, config)
        assert world.ego.speed_m_s * duration_s(config) <= 90.0 + 1e-6


def test_nothing_comes_near_the_camera(drawn):
    for config, world in drawn:
        for time in np.linspace(0.0, duration_s(config), 7):
            corners = corners_at(world, time).astype(np.float64)
            camera = np.array(world.ego.at(time).position_m)
            outside = np.maximum(corners.min(axis=1) - camera, camera - corners.max(axis=1))
            close = corners[(outside < 1.0).all(axis=1)]
            nearest = trimesh.triangles.closest_point(close, np.tile(camera, (len(close), 1)))
            assert np.linalg.norm(nearest - camera, axis=1).min(initial=np.inf) > 0.4


def test_camera_starts_at_the_origin(drawn):
    for _, world in drawn:
        x, y, z = world.ego.start.position_m
        assert (x, y) == (0.0, 0.0)
        assert 0.6 <= z <= 1.2


def test_most_worlds_have_something_moving(drawn):
    moving = [any(thing.motion.speed_m_s > 0 for thing in world.moving) for _, world in drawn]
    assert np.mean(moving) > 0.7


def test_moving_things_stand_on_the_ground(drawn):
    for config, world in drawn:
        for thing in world.moving:
            assert thing.mesh.corners[..., 2].min() == pytest.approx(0.0, abs=5e-3)
            for time in (0.0, duration_s(config)):
                above = np.add(thing.motion.at(time).position_m, (0.0, 0.0, 0.05))
                fall = cast(world.static.corners, above, np.array([[0.0, 0.0, -1.0]])).min()
                assert fall == pytest.approx(0.05, abs=0.015)


ASSETS = [
    vehicles.car, vehicles.van, heavy.lorry, heavy.bus,
    cycles.bicycle, cycles.cyclist, cycles.motorcycle, cycles.kick_scooter,
    people.adult, people.child, people.crouching, people.umbrella, people.pushchair,
    people.dog_walker, people.dog, people.suitcase,
    furniture.pole, furniture.sign, furniture.bollard, furniture.cone, furniture.crate,
    furniture.rubbish_bin, furniture.delineator, furniture.chevron_board, furniture.bench,
    furniture.cabinet, furniture.letter_box, furniture.planter,
    plants.broadleaf, plants.conifer, plants.bush, plants.poplar, plants.sapling,
    plants.grass_tuft, plants.reeds, shelters.bus_shelter, shelters.cycle_stand,
    buildings.roller_door, warehouse.pallet, warehouse.drum, warehouse.pallet_jack,
    warehouse.fork_lift, construction.worker, construction.excavator, construction.dumper,
    construction.barrier_board, construction.site_fence, construction.gravel_heap,
    construction.pipe_stack, construction.block_stack, construction.site_container,
    construction.portable_toilet, construction.scaffold, forest.trunk, forest.boulder, forest.log,
    forest.log_pile, forest.fern, forest.stump, forest.fallen_tree, forest.root_plate, forest.deer,
    snow.snow_bank, snow.snowman, snow.marker_stake, snow.chalet, snow.snow_plough, snow.sledge,
]  # fmt: skip
SIZED = {
    furniture.lamp_post: 6.0,
    plants.hedge: 8.0,
    furniture.fence: 8.0,
    furniture.guard_rail: 12.0,
    furniture.jersey_barrier: 12.0,
    buildings.facade: 9.0,
    buildings.pillar: 2.4,
    shelters.shop_front: 9.0,
    shelters.glass_railing: 8.0,
    warehouse.dock_door: 3.0,
    warehouse.pallet_rack: 3,
    construction.unfinished_wall: 6.0,
}
DRAWS = {draw.__name__: draw for draw in ASSETS} | {
    draw.__name__: partial(draw, **{list(signature(draw).parameters)[1]: size})
    for draw, size in SIZED.items()
}


@pytest.mark.parametrize("name", DRAWS)
def test_assets_stand_on_the_ground(name):
    rng = np.random.default_rng(5)
    for _ in range(5):
        mesh = DRAWS[name](rng)
        corners = mesh.corners
        assert name in mesh.kinds
        assert -2.0 < corners[..., 2].min() <= 1e-3
        assert len(corners) < 1000
        assert (np.linalg.norm(meshes.area_vectors(corners), axis=1) > 1e-9).all()


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
    pose = Motion(start, speed, rate).at(time)
    if rate:
        radius = speed / rate
        x = 1.0 + radius * (np.sin(0.4 + rate * time) - np.sin(0.4))
        y = -2.0 - radius * (np.cos(0.4 + rate * time) - np.cos(0.4))
    else:
        x, y = 1.0 + speed * time * np.cos(0.4), -2.0 + speed * time * np.sin(0.4)
    assert pose.position_m == pytest.approx((x, y, 0.5), abs=1e-9)
    assert pose.yaw_rad == pytest.approx(0.4 + rate * time)
    assert pose.pitch_rad == 0.1


def a_box(size=(1.0, 1.0, 1.0)) -> Mesh:
    return meshes.box(size, m.Material(0.2, 0.3))


def test_site_keeps_the_way_and_the_ground_free():
    site = Site(Motion(Pose((0.0, 0.0, 1.0)), 10.0), 1.0)
    assert not site.put(a_box(), 5.0, 0.0)
    assert site.put(a_box(), 5.0, 3.0)
    assert not site.put(a_box(), 5.5, 3.5)
    assert not site.move(a_box(), Motion(Pose((5.0, -6.0, 0.0), np.pi / 2), 12.0))
    assert site.move(a_box(), Motion(Pose((5.0, -6.0, 0.0), -np.pi / 2), 12.0))
    assert len(site.static) == 1
    assert len(site.moving) == 1


def test_site_lets_crowns_hang_over_and_rooms_end():
    site = Site(Motion(Pose((0.0, 0.0, 1.0)), 0.0), 1.0)
    post = meshes.join([a_box((0.2, 0.2, 3.0)), meshes.at(a_box((4.0, 4.0, 1.0)), 0.0, 0.0, 3.0)])
    assert site.put(post, 2.0, 0.0)
    assert site.put(a_box(), 3.0, 0.0)
    site.enclose((-10.0, 8.0), (-3.0, 3.0), 2.5)
    assert not site.put(a_box(), 8.0, 0.0)
    assert not site.put(a_box((1.0, 1.0, 2.6)), 5.0, 2.0)
    assert site.put(a_box(), 5.0, 2.0)


def test_solids_have_their_volume_and_face_outwards():
    rng = np.random.default_rng(0)
    solids = {
        1.0 * 2.0 * 3.0: a_box((1.0, 2.0, 3.0)),
        0.5 * 8 * np.sin(2 * np.pi / 8) * 0.25 * 2.0: meshes.rod(
            (0, 0, 1), (2, 0, 1), 0.5, m.SOIL.draw(rng)
        ),
        0.5 * 2.0: meshes.extrude([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)], 2.0, m.SOIL.draw(rng)),
    }
    for volume, mesh in solids.items():
        a, b, c = np.moveaxis(mesh.corners.astype(np.float64), 1, 0)
        assert (a * np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=1e-5)


def test_texture_has_one_scale_on_every_side_of_a_box():
    material = m.Material(0.2, 0.3, texture_m=0.5)
    mesh = meshes.box((1.0, 2.0, 3.0), material)
    edges = np.linalg.norm(mesh.corners - np.roll(mesh.corners, 1, axis=1), axis=2)
    on_texture = np.linalg.norm(mesh.uv - np.roll(mesh.uv, 1, axis=1), axis=2)
    assert on_texture == pytest.approx(edges / 0.5, rel=1e-5)


@pytest.mark.parametrize(
    ("family", "seed", "config", "named"),
    [
        ("moon", 0, CLIP, "family is 'moon'"),
        ("garage", -1, CLIP, "seed is -1"),
        ("garage", 0, WorldConfig(speed_m_s=(10, 15), frames_per_clip=256), "speed_m_s"),
    ],
)
def test_bad_arguments_are_named(family, seed, config, named):
    with pytest.raises(ValueError, match=named):
        draw_world(family, seed, config)


@pytest.mark.parametrize(("mirror", "clear"), [(-0.1, 0.0), (0.0, -0.1), (0.6, 0.5)])
def test_shares_that_are_mirrored_and_pass_are_checked(mirror, clear):
    message = f"mirror is {mirror:g} and clear is {clear:g}; expected shares"
    with pytest.raises(ValueError, match=message):
        m.Material(0.2, 0.3, mirror=mirror, clear=clear)


def test_shares_reach_every_face():
    pane = meshes.box((1.0, 1.0, 1.0), m.Material(0.2, 0.3, mirror=0.25, clear=0.5))
    assert (pane.mirror == np.float32(0.25)).all() and (pane.clear == np.float32(0.5)).all()
    assert len(pane.mirror) == len(pane.clear) == len(pane.corners)


HELD_OUT = {
    "warehouse": {"pallet_rack", "pallet", "drum", "pallet_jack", "fork_lift", "dock_door"},
    "construction_site": {
        "excavator", "dumper", "barrier_board", "site_fence", "gravel_heap", "pipe_stack",
        "block_stack", "site_container", "portable_toilet", "scaffold", "unfinished_wall",
        "light_tower",
    },
    "forest_path": {
        "trunk", "boulder", "log", "log_pile", "fern", "stump", "fallen_tree", "root_plate", "deer",
    },
    "snowy_street": {"chalet", "snow_bank", "snowman", "snow_plough", "marker_stake", "sledge"},
}  # fmt: skip
"""Kinds of things by the held-out family that shows them; `worker` is in two of them."""


@pytest.fixture(scope="module")
def kinds(drawn):
    """Kinds of things seen in each family, and in how many of its worlds; 17 worlds each."""
    seen = {family: Counter() for family in EVERY}
    for world in (world for _, world in drawn):
        seen[world.family].update(world.kinds)
    for family in EVERY:
        for seed in range(8):
            seen[family].update(draw_world(family, seed, CLIP).kinds)
    return seen


def test_held_out_kinds_are_in_no_training_family(kinds):
    held_out = set().union(*HELD_OUT.values(), {"worker"})
    for family in FAMILIES:
        assert not held_out & kinds[family].keys()


def test_held_out_families_show_their_own_kinds(kinds):
    for family, own in HELD_OUT.items():
        assert own <= kinds[family].keys()
        others = set().union(*(kinds_of for name, kinds_of in HELD_OUT.items() if name != family))
        assert not others & kinds[family].keys()


def test_each_family_has_variety(kinds):
    for family, least in zip(EVERY, (28, 28, 12, 12, 28, 7, 13, 12, 12), strict=True):
        assert len(kinds[family]) >= least, (family, sorted(kinds[family]))


def test_training_families_show_what_the_road_has_to_offer(kinds):
    shown = set().union(*(kinds[family].keys() for family in FAMILIES))
    assert shown >= {
        "car", "van", "lorry", "bus", "motorcycle", "cyclist", "bicycle", "kick_scooter",
        "adult", "child", "crouching", "umbrella", "pushchair", "dog_walker", "suitcase",
        "broadleaf", "conifer", "poplar", "sapling", "bush", "hedge", "grass_tuft", "reeds",
        "bus_shelter", "shop_front", "glass_railing", "ramp", "pillar", "lamp_post",
    }  # fmt: skip


def weathers(family, count=200):
    """Light and weather alone of many worlds: (low sun, wet, snowy) shares."""
    setting, rng = SETTINGS[family], np.random.default_rng(3)
    light = [setting.light(rng) for _ in range(count)]
    shares = (setting.wet_share, setting.snow_share, setting.snow_cover)
    sky = [weather.draw_weather(rng, *shares) for _ in range(count)]
    lowest = np.sin(lights.LOW_SUN_RAD)
    low = [one.sun_irradiance > 0 and one.sun_direction[2] < lowest for one in light]
    return np.mean(low), np.mean([w.wetness > 0 for w in sky]), np.mean([w.snow > 0 for w in sky])


def test_low_sun_wet_and_snow_have_their_shares():
    low, wet, snowy = np.transpose([weathers(family) for family in EVERY])
    # Standard error of a share of 200 draws is 0.035 at most.
    assert low == pytest.approx([0.3, 0, 0, 0.18, 0, 0, 0.15, 0.3, 0.35], abs=0.11)
    assert wet == pytest.approx([0.15, 0.4, 0, 0, 0.4, 0, 0.3, 0.2, 0], abs=0.11)
    assert snowy == pytest.approx([0, 0.12, 0, 0, 0.08, 0, 0, 0, 1], abs=0.11)


@pytest.fixture
def bench_mesh():
    return furniture.bench(np.random.default_rng(0))


def test_dry_weather_changes_nothing(bench_mesh):
    dry = weather.weathered(bench_mesh, weather.DRY)
    assert all((a == b).all() for a, b in zip(numbers(dry), numbers(bench_mesh), strict=True))


def test_wet_ground_is_darker_and_mirrors():
    ground = meshes.patch((0, 1), (0, 1), 0.0, m.Material(0.2, 0.4, retro=5.0))
    wet = weather.wetted(ground, 1.0)
    assert wet.albedo_high == pytest.approx(0.4 * (1 - weather.WET_DARKENING))
    assert wet.mirror == pytest.approx(weather.FILM_MIRROR)
    assert (weather.wetted(ground, 0.5).mirror < wet.mirror).all()


def test_snow_lies_on_what_faces_up_and_fills_the_texture_from_its_bright_end():
    cube = meshes.box((1.0, 1.0, 1.0), m.Material(0.1, 0.3, mirror=0.2, clear=0.1))
    top = np.isclose(cube.corners[..., 2], 1.0).all(axis=1)
    patchy, closed = weather.snowed(cube, 0.5), weather.snowed(cube, 1.0)
    assert patchy.albedo_low[top] == pytest.approx(0.1)
    assert patchy.albedo_high[top] == pytest.approx(weather.SNOW_ALBEDO)
    assert closed.albedo_low[top] == pytest.approx(weather.SNOW_ALBEDO)
    assert closed.mirror[top] == pytest.approx(0.0)
    assert closed.albedo_high[~top] == pytest.approx(0.3)
    assert closed.clear[~top] == pytest.approx(0.1)


def test_retro_reflectors_fill_a_tap_well_beyond_a_wall_does():
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    laser_w, distance_m, solid_angle_sr = 6.0, 5.0, 0.8
    per_radiance = electrons_per_radiance_second(sensor) * np.mean(sensor.integration_s)
    wall = laser_w / solid_angle_sr * 0.5 / np.pi / distance_m**2 * per_radiance / 2
    rng = np.random.default_rng(1)
    for finish, over in ((m.RETRO_SHEET, 1.0), (m.PLATE_SHEET, 0.5)):
        charges = [wall * (1 + finish.draw(rng).retro) for _ in range(50)]
        assert np.mean(np.array(charges) > sensor.full_well_e) >= over
    assert wall < 0.1 * sensor.full_well_e


def test_shares_of_the_light_stay_within_one(drawn):
    for _, world in drawn:
        for mesh in (world.static, *(thing.mesh for thing in world.moving)):
            assert (mesh.mirror >= 0).all() and (mesh.clear >= 0).all()
            assert (mesh.mirror + mesh.clear <= 1).all()


def test_moving_vehicles_carry_their_head_lights(drawn):
    carried = [
        (world.moving[lamp.carrier], lamp)
        for _, world in drawn
        for lamp in world.light.lamps
        if lamp.carrier is not None
    ]
    assert carried
    for thing, lamp in carried:
        nose, beside = thing.mesh.corners[..., 0].max(), thing.mesh.corners[..., 1].max()
        assert nose < lamp.position_m[0] < nose + 0.3
        assert abs(lamp.position_m[1]) < beside
        assert lamp.direction[0] > 0.9


def test_dark_worlds_alone_have_their_street_lamps_on(drawn):
    for _, world in drawn:
        if world.light.indoor is None:
            assert bool(world.light.lamps) <= lights.is_dark(world.light)
