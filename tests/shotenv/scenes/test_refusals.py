"""What cannot be read or mapped is refused by name, before memory is taken for it."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from render_worlds import square, wall
from scene_files import (
    STRAIGHT,
    edited_glb,
    scene_config,
    write_mesh,
    write_obj,
    write_xml,
)

from shotenv.config.bank import BankConfig, WorldConfig
from shotenv.config.mounts import MountConfig
from shotenv.config.reader import ConfigError
from shotenv.render.surfaces.mitsuba_file import SceneFileError, parse_mitsuba
from shotenv.scenes.bank_config import own_bank
from shotenv.scenes.scene_worlds import read_scene

pytestmark = pytest.mark.render
DIFFUSE = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.4"/></bsdf>'
FLOOR = f'<shape type="rectangle">{DIFFUSE}</shape>'


def refusal(path, **fields) -> str:
    with pytest.raises(SceneFileError) as refused:
        read_scene(scene_config(path, **fields))
    return str(refused.value)


# --- meshes


@pytest.mark.parametrize("name", ["scene.fbx", "scene", "missing.obj"])
def test_other_formats_and_missing_files_are_refused(tmp_path, name):
    if name != "missing.obj":
        (tmp_path / name).write_text("")
    assert "expected a file of .xml, .ply, .obj, .stl, .glb" in refusal(tmp_path / name)


@pytest.mark.parametrize("kind", ["obj", "xml"])
def test_a_scene_without_geometry_is_refused(tmp_path, kind):
    path = tmp_path / f"empty.{kind}"
    path.write_text("v 0 0 0\n" if kind == "obj" else '<scene version="3.0.0"/>')
    assert "empty" in refusal(path) and "no geometry" in refusal(path)


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "stl"])
@pytest.mark.parametrize("number", [np.nan, np.inf, 1e39, -1e7])
def test_corners_that_are_no_numbers_are_refused(tmp_path, kind, number):
    corners = wall(5.0).astype(float)
    corners[1, 2, 0] = number
    path = tmp_path / f"broken.{kind}"
    with np.errstate(all="ignore"):
        write_obj(path, corners) if kind == "obj" else write_mesh(path, corners)
    said = refusal(path)
    assert "broken" in said
    assert "1 faces with corners that are NaN or beyond 1e+06 m, the first of them face 1" in said


def test_a_hundred_million_faces_are_refused_by_the_header(tmp_path):
    ply = tmp_path / "huge.ply"
    ply.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 100000000\nproperty list uchar int vertex_indices\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    assert "has 100000000 faces; expected at most most_faces = 2000000" in refusal(ply)
    stl = tmp_path / "huge.stl"
    with stl.open("wb") as file:  # As long as it promises, without taking room on the disk.
        file.write(bytes(80) + struct.pack("<I", 100_000_000))
        file.truncate(84 + 50 * 100_000_000)
    assert "has 100000000 faces" in refusal(stl)
    glb = write_mesh(tmp_path / "huge.glb", wall(5.0))

    def promise(content):
        for accessor in content["accessors"]:
            accessor["count"] = 300_000_000

    assert "has 100000000 faces" in refusal(edited_glb(glb, promise))


def test_points_without_end_are_refused(tmp_path):
    path = tmp_path / "points.obj"
    path.write_text("v 0 0 0\n" * 31)
    assert "more vertices than 3 most_faces = 30" in refusal(path, most_faces=10)


def test_the_limit_of_faces_is_the_configuration_s(tmp_path):
    obj = tmp_path / "fan.obj"
    obj.write_text("v 5 0 0\nv 5 1 0\nv 5 1 1\n" + "f 1 2 3\n" * 6)
    assert "has 6 faces; expected at most most_faces = 5" in refusal(obj, most_faces=5)
    read_scene(scene_config(obj, most_faces=6))
    xml = write_xml(tmp_path / "two.xml", FLOOR * 2)
    assert "has 4 faces; expected at most most_faces = 3" in refusal(xml, most_faces=3)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("element vertex 9999999", "promises 9999999 of vertex"),
        ("element face -4", "'element face -4'; expected a count"),
        ("element face many", "'element face many'; expected a count"),
        ("element junk 99999999999999", "promises 99999999999999 of junk"),
    ],
)
def test_headers_that_promise_what_is_not_there_are_refused(tmp_path, line, said):
    path = tmp_path / "bad.ply"
    path.write_text(f"ply\nformat ascii 1.0\n{line}\nproperty float x\nend_header\n")
    assert said in refusal(path)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("no.ply", b"solid", "no PLY header"),
        ("cut.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\n"
                    b"end_header\n" + b"12345678", "cut.ply"),
        ("no.stl", b"\0" * 90, "promises 0 faces in 90 bytes"),
        ("no.glb", b"glTF", "cannot be read as GLB"),
        ("no.glb", b"PLAS" + bytes(40), "no GLB of version 2"),
        ("no.obj", b"v 0 0 0\nf 1 2 3\n", "line 2: 'f 1 2 3' cannot be read"),
        ("no.obj", b"v 0 0\nf 1 1 1\n", "a vertex without three coordinates"),
        ("no.obj", b"v a b c\n", "line 1: 'v a b c' cannot be read"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused(tmp_path, name, content, said):
    path = tmp_path / name
    path.write_bytes(content)
    assert said in refusal(path)


def glb(folder, change):
    return edited_glb(write_mesh(folder / "scene.glb", wall(5.0)), change)


@pytest.mark.parametrize("uri", ["../secret.bin", "https://example.org/x.bin", "/etc/passwd"])
def test_a_glb_that_reaches_elsewhere_is_refused(tmp_path, uri):
    path = glb(tmp_path, lambda content: content["buffers"][0].update(uri=uri))
    assert f"keeps numbers in {uri!r}; expected all in the file itself" in refusal(path)


def test_images_of_a_glb_are_not_opened(tmp_path):
    def with_image(content):
        content["images"] = [{"uri": "../../etc/passwd"}]
        content["textures"] = [{"source": 0}]
        content["materials"][0]["pbrMetallicRoughness"] = {"baseColorTexture": {"index": 0}}

    assert len(read_scene(scene_config(glb(tmp_path, with_image))).static.corners) == 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda c: c.update(extensionsRequired=["KHR_draco_mesh_compression"]), "KHR_draco"),
        (lambda c: c["meshes"][0]["primitives"][0].update(mode=1), "mode 1; expected triangles"),
        (lambda c: c["nodes"].__setitem__(0, {"children": [0]}), "nodes more than 64 deep"),
        (lambda c: c["accessors"][0].update(count=999_999), "cannot be read as GLB"),
    ],
)
def test_what_a_glb_has_beyond_triangles_is_refused(tmp_path, change, said):
    assert said in refusal(glb(tmp_path, change))


def test_nodes_of_a_glb_place_and_repeat_its_meshes(tmp_path):
    def twice(content):
        (mesh,) = [node for node in content["nodes"] if "mesh" in node]
        content["nodes"] = [
            {"children": [1, 2]},
            {"mesh": mesh["mesh"], "translation": [1, 0, 0]},
            {"mesh": mesh["mesh"], "scale": [1, 1, -1]},
        ]
        content["scenes"], content["scene"] = [{"nodes": [0]}], 0

    static = read_scene(scene_config(glb(tmp_path, twice), up="z")).static
    assert len(static.corners) == 4
    assert sorted(set(static.corners[..., 0].ravel().tolist())) == [5.0, 6.0]


def test_materials_without_an_entry_are_all_named(tmp_path):
    path = write_obj(tmp_path / "a.obj", wall(5.0), "rusty iron")
    with path.open("a") as file:
        file.write("\nusemtl glass\nf 1 2 3\n")
    said = refusal(path)
    assert "'rusty iron'" in said and "'glass'" in said and "table of materials" in said


def test_an_obj_uses_names_of_materials_and_polygons(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text(
        "# a pentagon\nv 5 0 0\nv 5 1 0\nv 5 1 1\nv 5 .5 2\nv 5 0 1\nusemtl red brick\n"
        "f 1/9/9 2 3 \\\n 4 5\nf -5 -4 -3\n"
    )
    table = {"red brick": {"albedo": (0.2, 0.5), "mirror": 0.1}}
    static = read_scene(scene_config(path, materials=table)).static
    assert len(static.corners) == 4
    assert set(static.albedo_high.tolist()) == {np.float32(0.5)}
    assert set(static.mirror.tolist()) == {np.float32(0.1)}


# --- Mitsuba's scenes

NAMED = '<bsdf type="{}" id="skin">{}</bsdf><shape type="sphere"><ref id="skin"/></shape>'


@pytest.mark.parametrize(
    ("bsdf", "inside", "said"),
    [
        ("principled", "", "'skin' (bsdf principled 'skin' has no counterpart)"),
        (
            "diffuse",
            '<rgb name="reflectance" value=".6,.1,.1"/>',
            "does not tell its albedo at 940",
        ),
        (
            "diffuse",
            '<texture type="checkerboard" name="reflectance"/>',
            "the texture checkerboard of bsdf diffuse 'skin' has no counterpart",
        ),
        ("twosided", '<bsdf type="roughconductor"/>', "bsdf roughconductor has no counterpart"),
    ],
)
def test_surfaces_without_a_counterpart_are_refused_unless_the_table_has_them(
    tmp_path, bsdf, inside, said
):
    path = write_xml(tmp_path / "a.xml", NAMED.format(bsdf, inside))
    assert said in refusal(path)
    static = read_scene(scene_config(path, materials={"skin": {"albedo": 0.3}})).static
    assert set(static.albedo_low.tolist()) == {np.float32(0.3)}


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ('<shape type="bsplinecurve"/>', "shape bsplinecurve cannot be mapped"),
        ('<shape type="frobnicate" id="f"/>', "shape frobnicate 'f' cannot be mapped"),
        ('<shape type="sphere"/>', "'default' (shape sphere has no BSDF)"),
        ('<medium type="homogeneous" id="fog"/>', "medium homogeneous 'fog' cannot be mapped"),
        (
            '<shape type="sphere" id="s"><medium type="homogeneous" name="interior"/>'
            + DIFFUSE + "</shape>",
            "medium homogeneous of shape sphere 's' cannot be mapped",
        ),
        ('<emitter type="envmap"/>', "emitter envmap cannot be mapped"),
        ('<emitter type="spot" id="s"/>', "emitter spot 's' cannot be mapped"),
        (
            '<emitter type="point"><rgb name="intensity" value="1,2,3"/></emitter>',
            "intensity of emitter point is a texture, a colour or no finite number",
        ),
        (
            '<emitter type="constant"><spectrum name="radiance" value="400:1,700:2"/></emitter>',
            "radiance of emitter constant",
        ),
        ('<emitter type="constant"/>' * 2, "have 2 skies; expected one"),
        ('<emitter type="directional"/>' * 2, "have 2 suns; expected one"),
        ('<emitter type="point"/>' * 17, "have 17 lamps"),
        (
            '<shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" value="1.5"/>'
            "</bsdf></shape>",
            "reflectance 1.5; expected 0 to 1",
        ),
        ('<shape type="ply"><string name="filename" value="../m.ply"/></shape>', "lies outside"),
        ('<shape type="ply"><string name="filename" value="none.ply"/></shape>', "is no file"),
        ('<shape type="sphere"><ref id="nobody"/></shape>', 'unresolved reference to "nobody"'),
        ('<include filename="../other.xml"/>', "'../other.xml', which lies outside"),
        ('<default name="x" value="y.xml"/><include filename="$x"/>', "without parameters"),
        ('<path value="/tmp"/>', "adds a search path"),
        ("<shape", "is no XML"),
        (
            '<shape type="sphere" id="s"><float name="radius" value="nan"/>' + DIFFUSE + "</shape>",
            "radius of shape sphere 's' is nan; expected finite numbers",
        ),
        (
            '<emitter type="directional"><vector name="direction" x="0" y="0" z="0"/></emitter>',
            "direction of emitter directional is (0, 0, 0)",
        ),
        (
            '<shape type="rectangle" id="r"><transform name="to_world"><scale value="0"/>'
            "</transform>" + DIFFUSE + '<emitter type="area"/></shape>',
            "shape rectangle 'r' glows, but its faces have no area",
        ),
        ('<integrator type="path"/><volume type="gridvolume"/>', "volume gridvolume"),
    ],
)  # fmt: skip
def test_what_a_scene_cannot_have_here_is_refused_by_name(tmp_path, body, said):
    assert said in refusal(write_xml(tmp_path / "a.xml", FLOOR + body), albedo=None)


def test_entities_and_other_roots_are_refused(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text('<!DOCTYPE s [<!ENTITY a "b">]><scene version="3.0.0">&a;</scene>')
    assert "document type or entities" in refusal(path)
    path.write_text('<shape version="3.0.0" type="sphere"/>')
    assert "expected a scene" in refusal(path)


def test_includes_without_end_and_wide_references_are_refused_or_read_once(tmp_path):
    loop = write_xml(tmp_path / "loop.xml", '<include filename="loop.xml"/>')
    assert "expected at most 8" in refusal(loop)
    bsdfs = '<bsdf type="diffuse" id="b0"/>' + "".join(
        f'<bsdf type="blendbsdf" id="b{n}"><float name="weight" value="0.5"/>'
        f'<ref id="b{n - 1}"/><ref id="b{n - 1}"/></bsdf>'
        for n in range(1, 60)
    )
    path = write_xml(tmp_path / "wide.xml", bsdfs + '<shape type="sphere"><ref id="b59"/></shape>')
    assert len(parse_mitsuba(path)) == 61
    assert "blendbsdf 'b59' has no counterpart" in refusal(path)


def test_meshes_and_includes_beside_a_scene_are_read(tmp_path):
    (tmp_path / "parts").mkdir()
    write_mesh(tmp_path / "parts" / "m.ply", wall(5.0))
    shape = f'<shape type="ply"><string name="filename" value="parts/m.ply"/>{DIFFUSE}</shape>'
    write_xml(tmp_path / "inner.xml", shape)
    path = write_xml(
        tmp_path / "outer.xml", '<include filename="inner.xml"/><sensor type="thinlens"/>'
    )
    assert len(read_scene(scene_config(path)).static.corners) == 2


# --- ways

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
