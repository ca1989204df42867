"""What of Mitsuba's scenes has no counterpart is refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from render_worlds import wall
from scene_files import (
    refusal,
    scene_config,
    write_mesh,
    write_xml,
)

from shotenv.render.surfaces.mitsuba_file import parse_mitsuba
from shotenv.scenes.scene_worlds import read_scene

pytestmark = pytest.mark.render
DIFFUSE = '<bsdf type="diffuse"><spectrum name="reflectance" value="0.4"/></bsdf>'
FLOOR = f'<shape type="rectangle">{DIFFUSE}</shape>'


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
    path.write_text(path.read_text(), encoding="utf-16")
    assert "UTF-16 or UTF-32; expected UTF-8" in refusal(path)
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
