"""Meshes that cannot be read or mapped are refused by name, before memory is taken for them."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from render_worlds import wall
from scene_files import (
    edited_glb,
    refusal,
    scene_config,
    write_mesh,
    write_obj,
    write_xml,
)

from shotenv.scenes.scene_worlds import read_scene

pytestmark = pytest.mark.render
DIFFUSE = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.4"/></bsdf>'
FLOOR = f'<shape type="rectangle">{DIFFUSE}</shape>'


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
