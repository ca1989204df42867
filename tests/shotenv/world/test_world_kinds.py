"""What each family shows: kinds of things, weather, low sun, lamps, reflectors."""

from collections import Counter
from typing import get_args

import numpy as np
import pytest
from drawn_worlds import CLIP, EVERY, arrays_of, drawn_worlds, movers_of, route_of

from shotenv.config.families import FAMILIES, TRAINING_FAMILIES, Family
from shotenv.config.reader import find_config, read_config
from shotenv.config.sensor import SensorConfig
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.world.draw import draw_world
from shotenv.world.families.settings import SETTINGS
from shotenv.world.geometry import lights, materials as m, meshes, weather
from shotenv.world.geometry.motion import rotation
from shotenv.world.geometry.mover import posed
from shotenv.world.things import furniture


@pytest.fixture(scope="module")
def drawn():
    return drawn_worlds()


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
    for family in (*FAMILIES, *TRAINING_FAMILIES):
        assert not held_out & kinds[family].keys()


def test_held_out_families_show_their_own_kinds(kinds):
    for family, own in HELD_OUT.items():
        assert own <= kinds[family].keys()
        others = set().union(*(kinds_of for name, kinds_of in HELD_OUT.items() if name != family))
        assert not others & kinds[family].keys()


def test_each_family_has_variety(kinds):
    for family, least in zip(EVERY, (28, 28, 12, 12, 28, 7, 13, 12, 12, 16), strict=True):
        assert len(kinds[family]) >= least, (family, sorted(kinds[family]))


def test_training_families_show_what_the_road_has_to_offer(kinds):
    shown = set().union(*(kinds[family].keys() for family in FAMILIES))
    assert shown >= {
        "car", "van", "lorry", "bus", "motorcycle", "cyclist", "bicycle", "kick_scooter",
        "adult", "child", "crouching", "umbrella", "pushchair", "dog_walker", "suitcase",
        "broadleaf", "conifer", "poplar", "sapling", "bush", "hedge", "grass_tuft", "reeds",
        "bus_shelter", "shop_front", "glass_railing", "ramp", "pillar", "lamp_post",
    }  # fmt: skip


def test_every_family_has_its_setting_whose_shares_add_up_to_one():
    assert tuple(SETTINGS) == EVERY == get_args(Family)
    for family, setting in SETTINGS.items():
        assert sum(place.share for place in setting.places) == pytest.approx(1.0), family
        assert setting.wet_share + setting.snow_share <= 1.0


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
    assert low == pytest.approx([0.3, 0, 0, 0.18, 0, 0, 0.15, 0.3, 0.35, 0.14], abs=0.11)
    assert wet == pytest.approx([0.15, 0.4, 0, 0, 0.4, 0, 0.3, 0.2, 0, 0], abs=0.11)
    assert snowy == pytest.approx([0, 0.12, 0, 0, 0.08, 0, 0, 0, 1, 0], abs=0.11)


@pytest.fixture
def bench_mesh():
    return furniture.bench(np.random.default_rng(0))


def test_dry_weather_changes_nothing(bench_mesh):
    dry = weather.weathered(bench_mesh, weather.DRY)
    assert all((a == b).all() for a, b in zip(arrays_of(dry), arrays_of(bench_mesh), strict=True))


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
        (pieces, lamp)
        for _, world in drawn
        for lamp in world.light.lamps
        for pieces in movers_of(world)
        if lamp.carrier is not None and world.moving[lamp.carrier] is pieces[0]
    ]
    assert carried
    for pieces, lamp in carried:
        body = route_of(pieces[0].motion).at(0.0)
        corners = [posed(piece.mesh, piece.motion.at(0.0)).corners for piece in pieces]
        own = (np.concatenate(corners) - body.position_m) @ rotation(body)
        nose, beside = own[..., 0].max(), own[..., 1].max()
        assert nose < lamp.position_m[0] < nose + 0.3
        assert abs(lamp.position_m[1]) < beside
        assert lamp.direction[0] > 0.9


def test_dark_worlds_alone_have_their_street_lamps_on(drawn):
    lit = {False: 0, True: 0}
    # Lamps of clutter burn at any hour.
    outdoors = [w for _, w in drawn if w.light.indoor is None and w.family != "clutter"]
    for light, kinds in ((w.light, w.kinds) for w in outdoors):
        # At dusk lamps are there, and come on within the clip.
        dark = lights.is_dark(light) or light.fading_per_s > 0
        posts = {"lamp_post", "light_tower"} & kinds
        assert dark or not light.lamps
        assert any(lamp.position_m[2] > 3.0 for lamp in light.lamps) == bool(dark and posts)
        lit[dark] += bool(posts)
    # Posts stand by day as well, and are off.
    assert min(lit.values()) > 0
