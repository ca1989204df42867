"""Ways through walls, too fast or too short are refused by name."""

from __future__ import annotations

import json

import pytest
from render_worlds import square
from scene_files import (
    STRAIGHT,
    write_obj,
    write_xml,
)

from shotenv.config.bank import BankConfig, WorldConfig
from shotenv.config.mounts import MountConfig
from shotenv.config.reader import ConfigError
from shotenv.scenes.bank_config import own_bank

pytestmark = pytest.mark.render
DIFFUSE = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.4"/></bsdf>'
FLOOR = f'<shape type="rectangle">{DIFFUSE}</shape>'


BOX = (
    '<shape type="cube"><transform name="to_world"><translate x="{}" z="1"/></transform>{}{}'
    "</shape>"
)
INWARD = '<boolean name="flip_normals" value="true"/>'


@pytest.fixture
def base(sensor) -> BankConfig:
    return BankConfig(name="base", sensor=sensor)


def planned(base, folder, body, **clip):
    way = folder / "way.yaml"
    way.write_text(json.dumps({"clips": [clip or STRAIGHT]}))
    return own_bank(base, write_xml(folder / "a scene.xml", body), way)


def test_a_way_through_free_space_is_planned(base, tmp_path):
    bank = planned(base, tmp_path, FLOOR)
    assert bank.name == "a-scene" and bank.own_scene is not None
    assert bank.own_scene.digest != "0" * 64


@pytest.mark.parametrize("at", [0.0, 0.5])
def test_a_way_through_a_wall_is_refused(base, tmp_path, at):
    front = f'<shape type="rectangle"><transform name="to_world"><scale value="3"/><rotate y="1" '\
        f'angle="90"/><translate x="0.63" y="{at}"/></transform>{DIFFUSE}</shape>'  # fmt: skip
    with pytest.raises(
        ValueError, match=r"clips\[0\], mount camera, goes through a surface at \(0.63"
    ):
        planned(base, tmp_path, front)


def test_a_camera_beside_the_car_must_not_touch_a_wall_either(base, tmp_path):
    side = f'<shape type="rectangle"><transform name="to_world"><scale value="0.4"/><rotate y="1" '\
        f'angle="90"/><translate x="0.63" y="2" z="1"/></transform>{DIFFUSE}</shape>'  # fmt: skip
    planned(base, tmp_path, side)
    mounts = (MountConfig(), MountConfig(name="mirror", position_m=(0.0, 2.0, 0.0)))
    wide = base.model_copy(update={"world": WorldConfig(mounts=mounts)})
    with pytest.raises(ValueError, match=r"mount mirror, goes through a surface"):
        planned(wide, tmp_path, side)


def test_a_way_inside_a_solid_is_refused_and_inside_a_room_is_not(base, tmp_path):
    still = {"poses": [{"time_s": t, "position_m": (0, 0, 1)} for t in (0, 1)]}
    with pytest.raises(ValueError, match=r"is inside a closed body at \(0.00, 0.00, 1.00\) m"):
        planned(base, tmp_path, BOX.format(0, "", DIFFUSE), **still)
    planned(base, tmp_path, BOX.format(0, INWARD, DIFFUSE), **still)
    planned(base, tmp_path, BOX.format(4, "", DIFFUSE) + FLOOR, **still)


def test_a_way_that_is_too_fast_or_too_short_is_refused(base, tmp_path):
    fast = {"waypoints_m": [(0, 0, 1), (90, 0, 1)], "speed_m_s": [(0, 50), (1, 70)]}
    with pytest.raises(ValueError, match=r"moves at \d+.\d m/s .* expected at most 60 m/s"):
        planned(base, tmp_path, FLOOR, **fast)
    brief = {"poses": [{"time_s": t, "position_m": (0, 0, 1)} for t in (0, 0.09)]}
    with pytest.raises(ValueError, match=r"clips\[0\] is 0.09 s long, 0 frames at 10 Hz"):
        planned(base, tmp_path, FLOOR, **brief)


def test_files_of_paths_and_materials_are_refused_by_field(base, tmp_path):
    scene, way = write_xml(tmp_path / "a.xml", FLOOR), tmp_path / "way.yaml"
    for content, said in (
        ("clips: []", "clips"),
        ("clips: [{split: holdout}]", "split"),
        (json.dumps({"clips": [STRAIGHT], "unit": 1}), "unit"),
        (json.dumps({"clips": [STRAIGHT], "unit_m": -1}), "unit_m"),
        (json.dumps({"clips": [STRAIGHT], "up": "x"}), "up"),
    ):
        way.write_text(content)
        with pytest.raises(ConfigError, match=said):
            own_bank(base, scene, way)
    way.write_text(json.dumps({"clips": [STRAIGHT]}))
    table = tmp_path / "materials.yaml"
    for content, said in (
        ("materials: {a: {albedo: 1.5}}", "albedo"),
        ("materials: {a: {albedo: 0.5, mirror: 0.8, clear: 0.4}}", "mirror"),
        ("materials: {a: {}}", "albedo"),
    ):
        table.write_text(content)
        with pytest.raises(ConfigError, match=said):
            own_bank(base, scene, way, table)


def test_the_floor_under_a_square_is_not_in_the_way(base, tmp_path):
    """The path's own height counts: a plane just below it is free space above."""
    path = write_obj(tmp_path / "floor.obj", square((0, 0, 0.99), (5, 0, 0), (0, 5, 0)))
    way, table = tmp_path / "way.yaml", tmp_path / "table.yaml"
    way.write_text(json.dumps({"clips": [STRAIGHT]}))
    table.write_text("materials: {default: {albedo: 0.3}}")
    assert own_bank(base, path, way, table).name == "floor"
