"""A scene from a file is rendered like the same triangles made here, and like closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from render_worlds import (
    ALBEDO,
    MIDDLE,
    SMALL,
    at,
    laser_return,
    mesh,
    ray_directions,
    wall,
    world,
)
from scene_files import scene_config, write_mesh, write_obj, write_xml

from shotenv.config.mounts import MountConfig
from shotenv.render.backend.llvm import start_mitsuba
from shotenv.render.integrator import trace
from shotenv.scenes.scene_worlds import own_world, read_scene

pytestmark = pytest.mark.render
WALL_M = 5.0
RECTANGLE = (
    '<shape type="rectangle"><transform name="to_world"><scale value="60"/>'
    '<rotate y="1" angle="-90"/><translate x="5"/></transform>{}</shape>'
)
GREY = (
    '<bsdf type="twosided" id="grey"><bsdf type="diffuse">'
    '<spectrum name="reflectance" value="0.4"/></bsdf></bsdf>'
)
TO_Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""World axes to those of a file with y up."""


@pytest.fixture(scope="module", autouse=True)
def _variant():
    start_mitsuba()


def traced(path, **fields):
    config = scene_config(path, **fields)
    return trace(own_world(read_scene(config), config, 0, MountConfig()), at(0.0), SMALL, seed=0)


def written(folder, kind: str):
    path = folder / f"wall.{kind}"
    if kind == "obj":
        return write_obj(path, wall(WALL_M))
    if kind == "glb":
        return write_mesh(path, wall(WALL_M) @ TO_Y_UP.T)
    if kind == "xml":
        return write_xml(path, RECTANGLE.format(GREY))
    return write_mesh(path, wall(WALL_M))


@pytest.mark.parametrize("kind", ["obj", "ply", "stl", "glb", "xml"])
def test_a_wall_of_each_format_is_the_wall_of_a_world(tmp_path, kind):
    made = trace(world(mesh(wall(WALL_M))), at(0.0), SMALL, seed=0)
    read = traced(written(tmp_path, kind))
    np.testing.assert_allclose(read.distance_m, made.distance_m, atol=1e-4)
    np.testing.assert_allclose(read.active, made.active, rtol=1e-4)
    assert read.active[0][MIDDLE] == pytest.approx(laser_return(WALL_M, 1.0), rel=1e-3)


@pytest.mark.parametrize("albedo", [0.1, 0.8])
def test_a_material_returns_light_by_the_albedo_of_the_table(tmp_path, albedo):
    path = write_obj(tmp_path / "wall.obj", wall(WALL_M), "brushed steel")
    read = traced(path, materials={"brushed steel": {"albedo": albedo}})
    expected = laser_return(WALL_M, 1.0) * albedo / ALBEDO
    assert read.active[0][MIDDLE] == pytest.approx(expected, rel=1e-3)


def test_the_table_has_the_last_word_on_what_a_scene_tells(tmp_path):
    path = write_xml(tmp_path / "wall.xml", RECTANGLE.format(GREY))
    read = traced(path, materials={"grey": {"albedo": 0.2}})
    assert read.active[0][MIDDLE] == pytest.approx(laser_return(WALL_M, 1.0) / 2, rel=1e-3)


def test_units_and_axes_are_as_told(tmp_path):
    path = write_mesh(tmp_path / "wall.ply", 100 * wall(WALL_M) @ TO_Y_UP.T)
    made = trace(world(mesh(wall(WALL_M))), at(0.0), SMALL, seed=0)
    read = traced(path, up="y", unit_m=0.01)
    np.testing.assert_allclose(read.distance_m, made.distance_m, atol=1e-4)


@pytest.mark.parametrize("as_transform", [False, True])
def test_a_sphere_is_as_far_as_a_sphere(tmp_path, as_transform):
    centre, radius = np.array([4.0, 0.2, 1.1]), 1.5
    place = (
        '<point name="center" x="4" y="0.2" z="1.1"/><float name="radius" value="1.5"/>'
        if not as_transform
        else '<transform name="to_world"><scale value="1.5"/><translate x="4" y="0.2" z="1.1"/>'
        "</transform>"
    )
    path = write_xml(tmp_path / "ball.xml", f'<shape type="sphere">{place}{GREY}</shape>')
    read = traced(path)
    eye = np.array([0.0, 0.0, 1.0])
    along = ray_directions(SMALL) @ (centre - eye)
    under = along**2 - ((centre - eye) ** 2).sum() + radius**2
    expected = np.where(under > 0, along - np.sqrt(np.maximum(under, 0)), np.inf)
    # At the rim a ray runs along the surface, where a quarter of a millimetre is much further.
    steep = under > 0.05
    assert steep.sum() > 100
    assert np.abs(read.distance_m[0][steep] - expected[steep]).max() < 1e-3
    assert np.isinf(read.distance_m[0][under < -0.01]).all()


def test_round_shapes_and_boxes_stand_where_mitsuba_has_them(tmp_path):
    """Mitsuba's own shapes, hit by Mitsuba's own rays."""
    body = (
        '<shape type="cylinder"><point name="p0" x="4" y="-1" z="0"/>'
        '<point name="p1" x="4" y="-0.7" z="2"/><float name="radius" value="0.5"/>{0}</shape>'
        '<shape type="disk"><transform name="to_world"><rotate y="1" angle="-80"/>'
        '<translate x="5" y="0.6" z="1.4"/></transform>{0}</shape>'
        '<shape type="cube"><transform name="to_world"><scale x="0.3" y="0.4" z="-0.5"/>'
        '<rotate z="1" angle="30"/><translate x="3" y="0.3" z="0.6"/></transform>{0}</shape>'
    ).format(GREY.replace(' id="grey"', ""))
    path = write_xml(tmp_path / "shapes.xml", body)
    read = traced(path, albedo=None).distance_m[0]
    import mitsuba as mi

    scene = mi.load_file(str(path))
    away = ray_directions(SMALL).reshape(-1, 3).T
    start = mi.Point3f(*(mi.Float(np.full(away.shape[1], n, np.float32)) for n in (0, 0, 1)))
    ray = mi.Ray3f(start, mi.Vector3f(*(mi.Float(np.float32(axis)) for axis in away)))
    theirs = scene.ray_intersect_preliminary(ray).t.numpy().reshape(read.shape)
    both = np.isfinite(read) & np.isfinite(theirs)
    assert both.sum() > 60 and (np.isfinite(read) != np.isfinite(theirs)).sum() <= 2
    apart = np.abs(read[both] - theirs[both])
    assert np.median(apart) < 1e-4 and np.quantile(apart, 0.9) < 2e-3


def test_a_luminaire_lights_the_floor_as_its_size_and_radiance_say(tmp_path):
    """On its axis, E = pi L r^2 / (d^2 + r^2) for a disk of its area; and its face glows."""
    path = write_xml(
        tmp_path / "lamp.xml",
        GREY + '<shape type="rectangle"><transform name="to_world"><scale value="50"/></transform>'
        '<ref id="grey"/></shape>'
        '<shape type="disk"><transform name="to_world"><scale value="0.2"/>'
        '<rotate x="1" angle="180"/><translate z="3"/></transform><ref id="grey"/>'
        '<emitter type="area"><spectrum name="radiance" value="7"/></emitter></shape>',
    )
    down = {"poses": [{"time_s": t, "position_m": (0, 0, 2.0), "pitch_deg": 90.0} for t in (0, 1)]}
    read = traced(path, clips=[down])
    expected = ALBEDO / math.pi * math.pi * 7 * 0.04 / (9 + 0.04)
    assert read.ambient[0][MIDDLE] == pytest.approx(expected, rel=2e-3)
    up = {"poses": [{"time_s": t, "position_m": (0, 0, 2.0), "pitch_deg": -89.9} for t in (0, 1)]}
    assert traced(path, clips=[up]).ambient[0].max() == pytest.approx(7.0, rel=0.02)


def test_a_flat_lamp_has_a_lambertian_s_flux_and_nearly_its_directions():
    from shotenv.render.light import spot_falloff

    cosine = np.linspace(0.0, 1.0, 2001)
    lamp = spot_falloff(mi_float(cosine), 0.0).numpy()
    assert np.trapezoid(lamp, cosine) == pytest.approx(0.5, rel=1e-4)
    near = cosine >= 0.5
    assert (lamp[near] / cosine[near]).max() == pytest.approx(1.125, rel=1e-3)
    assert (lamp[near] / cosine[near]).min() >= 1 - 1e-6
    assert (lamp[~near] <= cosine[~near] + 1e-6).all()


def mi_float(numbers):
    import mitsuba as mi

    return mi.Float(np.float32(numbers))


def test_sun_sky_and_point_lamps_of_a_scene_are_those_of_a_world(tmp_path):
    path = write_xml(
        tmp_path / "lit.xml",
        RECTANGLE.format(GREY)
        + '<emitter type="directional"><vector name="direction" x="3" y="0" z="-4"/>'
        '<spectrum name="irradiance" value="6"/></emitter>'
        '<emitter type="constant"><spectrum name="radiance" value="0.5"/></emitter>'
        '<emitter type="point"><point name="position" x="1" y="2" z="3"/>'
        '<spectrum name="intensity" value="4"/></emitter>',
    )
    light = read_scene(scene_config(path)).light
    assert light.sun_irradiance == 6 and light.sun_direction == pytest.approx((-0.6, 0, 0.8))
    assert (light.sky_zenith, light.sky_horizon) == (0.5, 0.5)
    (lamp,) = light.lamps
    assert lamp.position_m == (1, 2, 3) and lamp.intensity_w_sr == 4 and lamp.cutoff_cos == -1


def test_lights_of_the_configuration_are_those_of_a_world(tmp_path):
    path = write_obj(tmp_path / "wall.obj", wall(WALL_M))
    told = {
        "sun": {"irradiance": 5.0, "azimuth_deg": 180.0, "elevation_deg": 30.0},
        "sky": {"zenith": 0.2, "horizon": 0.3},
        "lamps": [{"position_m": (1, 0, 2), "intensity_w_sr": 2, "direction": (0, 0, -2),
                   "cutoff_deg": 60, "rides": True}],
    }  # fmt: skip
    light = read_scene(scene_config(path, lights=told)).light
    assert light.sun_direction == pytest.approx((-math.cos(math.pi / 6), 0, 0.5))
    (lamp,) = light.lamps
    assert lamp.cutoff_cos == pytest.approx(0.5) and lamp.rides
    assert lamp.direction == (0, 0, -1)


def test_a_glowing_ball_shines_to_all_sides_with_its_projected_area(tmp_path):
    path = write_xml(
        tmp_path / "ball.xml",
        '<shape type="sphere"><float name="radius" value="0.5"/>' + GREY + "</shape>",
    )
    (lamp,) = read_scene(scene_config(path, materials={"grey": {"albedo": 0.4, "emission": 3.0}}))\
        .light.lamps  # fmt: skip
    assert lamp.intensity_w_sr == pytest.approx(3.0 * math.pi * 0.25, rel=2e-3)
    assert lamp.cutoff_cos == -1 and lamp.radius_m == pytest.approx(0.5, rel=1e-3)


def test_the_digest_follows_triangles_surfaces_and_lights_alone(tmp_path):
    path = write_obj(tmp_path / "wall.obj", wall(WALL_M))
    digest = read_scene(scene_config(path)).digest
    (tmp_path / "elsewhere").mkdir()
    moved = write_obj(tmp_path / "elsewhere" / "same.obj", wall(WALL_M))
    assert read_scene(scene_config(moved)).digest == digest
    others = [
        scene_config(path, albedo=0.41),
        scene_config(path, lights={"sky": {"zenith": 0.2, "horizon": 0.3}}),
        scene_config(write_obj(tmp_path / "far.obj", wall(WALL_M + 0.01))),
    ]
    assert len({digest, *(read_scene(other).digest for other in others)}) == 4


@pytest.mark.parametrize(
    ("mount", "moved"),
    [
        (MountConfig(position_m=(1.0, 0.5, -0.2)), (1.0, 0.5, 0.8, 0.0)),
        (MountConfig(yaw_deg=30.0), (0.0, 0.0, 1.0, 30.0)),
    ],
)
def test_a_mounted_camera_sees_what_one_at_its_place_sees(tmp_path, mount, moved):
    path = write_obj(tmp_path / "wall.obj", wall(WALL_M))
    config = scene_config(path)
    scene = read_scene(config)
    seen = trace(own_world(scene, config, 0, mount), at(0.0), SMALL, seed=0)
    there = own_world(scene, config, 0, MountConfig())
    x, y, z, yaw_deg = moved
    pose = replace(there.ego.at(0.0), position_m=(x, y, z), yaw_rad=math.radians(yaw_deg))
    fixed = type("Fixed", (), {"at": lambda self, time_s: pose})()
    expected = trace(replace(there, ego=fixed), at(0.0), SMALL, seed=0)
    np.testing.assert_allclose(seen.distance_m, expected.distance_m, atol=1e-4)
