"""The things that worlds are made of."""

from functools import partial
from importlib import import_module
from inspect import isfunction, signature
from pkgutil import iter_modules

import numpy as np
import pytest
from drawn_worlds import plain_box

from shotenv.world import families, things
from shotenv.world.families import clutter, construction, forest, snow, warehouse
from shotenv.world.geometry import Mover, materials as m, meshes
from shotenv.world.things import (
    buildings,
    cycles,
    furniture,
    heavy,
    people,
    plants,
    shelters,
    vehicles,
)

ASSETS = [
    vehicles.car, vehicles.van, heavy.lorry, heavy.bus,
    cycles.bicycle, cycles.cyclist, cycles.motorcycle, cycles.kick_scooter,
    people.adult, people.child, people.crouching, people.umbrella, people.pushchair,
    people.dog_walker, people.suitcase,
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
    clutter.solid_box: 1.0,
    clutter.cylinder: 1.0,
    clutter.sphere: 1.0,
    clutter.turned_solid: 1.0,
    clutter.lump: 1.0,
    clutter.panel: 1.0,
    clutter.shelf: 1.0,
    clutter.street_thing: 1.0,
}
DRAWS = (
    {draw.__name__: draw for draw in ASSETS}
    | {
        draw.__name__: partial(draw, **{list(signature(draw).parameters)[1]: size})
        for draw, size in SIZED.items()
    }
    | {
        "light_tower": partial(construction.light_tower, height_m=4.0, radiance=0.5),
        "wall": partial(buildings.wall, length_m=8.0, height_m=1.5),
    }
)


def marked_as_things():
    """Names of all functions of both rooms that `meshes.thing` has wrapped."""
    for room in (things, families):
        for file in iter_modules(room.__path__):
            module = import_module(f"{room.__name__}.{file.name}")
            for function in vars(module).values():
                own = isfunction(function) and function.__module__ == module.__name__
                if own and hasattr(function, "__wrapped__"):
                    yield function.__name__


def test_every_thing_is_among_those_tested_here():
    assert set(marked_as_things()) == set(DRAWS)


@pytest.mark.parametrize("name", DRAWS)
def test_assets_stand_on_the_ground(name):
    rng = np.random.default_rng(5)
    for _ in range(5):
        drawn = DRAWS[name](rng)
        mesh = drawn.at_rest if isinstance(drawn, Mover) else drawn
        corners = mesh.corners
        assert name in mesh.kinds
        assert -2.0 < corners[..., 2].min() <= 1e-3
        assert len(corners) < 1000
        assert (np.linalg.norm(meshes.area_vectors(corners), axis=1) > 1e-9).all()


def test_solids_have_their_volume_and_face_outwards():
    rng = np.random.default_rng(0)
    solids = {
        1.0 * 2.0 * 3.0: plain_box((1.0, 2.0, 3.0)),
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


@pytest.mark.parametrize(("mirror", "clear"), [(-0.1, 0.0), (0.0, -0.1), (0.6, 0.5)])
def test_shares_that_are_mirrored_and_pass_are_checked(mirror, clear):
    message = f"mirror is {mirror:g} and clear is {clear:g}; expected shares"
    with pytest.raises(ValueError, match=message):
        m.Material(0.2, 0.3, mirror=mirror, clear=clear)


def test_shares_reach_every_face():
    pane = meshes.box((1.0, 1.0, 1.0), m.Material(0.2, 0.3, mirror=0.25, clear=0.5))
    assert (pane.mirror == np.float32(0.25)).all() and (pane.clear == np.float32(0.5)).all()
    assert len(pane.mirror) == len(pane.clear) == len(pane.corners)
