"""The family for training only: places of every size, where reflectance tells no distance."""

import numpy as np
import pytest
from drawn_worlds import CLIP
from test_world import cast, corners_at, view

from shotenv.world.draw import draw_world
from shotenv.world.families import clutter
from shotenv.world.geometry import lights
from shotenv.world.geometry.model import MAX_LAMPS

SEEDS = range(60)


@pytest.fixture(scope="module")
def worlds():
    return [draw_world("clutter", seed, CLIP) for seed in SEEDS]


@pytest.fixture(scope="module")
def seen(worlds):
    """For each world distance and mean albedo along the camera rays that meet something."""
    result = []
    for world in worlds:
        meshes = [world.static, *(thing.mesh for thing in world.moving)]
        albedo = np.concatenate([(m.albedo_low + m.albedo_high) / 2 for m in meshes])
        pose = world.ego.at(0.0)
        hits = cast(corners_at(world, 0.0), np.array(pose.position_m), view(pose, 8, 6))
        distance, face = hits.min(axis=1), hits.argmin(axis=1)
        met = np.isfinite(distance)
        result.append((distance[met], albedo[face[met]]))
    return result


def test_distances_are_those_of_rooms_halls_and_open_ground(seen):
    distance = np.concatenate([distance for distance, _ in seen])
    below = {far: np.mean(distance < far) for far in (2.0, 6.0, 15.0, 30.0, 60.0)}
    assert below[2.0] > 0.03
    assert below[6.0] < 0.8
    assert below[15.0] < 0.97
    assert below[30.0] < 0.99
    assert below[60.0] > 0.98


def test_reflectance_does_not_depend_on_distance(seen):
    """Within worlds and over all of them; two or three walls of a world share one albedo."""
    seen = [(np.log(distance), albedo) for distance, albedo in seen if len(distance) > 3]
    log_distance, albedo = (np.concatenate(part) for part in zip(*seen, strict=True))
    assert abs(np.corrcoef(log_distance, albedo)[0, 1]) < 0.12
    # Where all that is seen has one albedo, its deviation is that of float32's rounding.
    within = [np.corrcoef(*one)[0, 1] for one in seen if all(part.std() > 1e-6 for part in one)]
    assert abs(np.mean(within)) < 0.15


def test_reflectance_does_not_depend_on_kind_and_covers_its_range():
    rng = np.random.default_rng(0)
    kinds = (clutter.solid_box, clutter.sphere, clutter.panel, clutter.shelf, clutter.street_thing)
    drawn = [[kind(rng, 1.0) for _ in range(150)] for kind in kinds]
    means = [[mesh.albedo_low.mean() for mesh in meshes] for meshes in drawn]
    # Standard error of a mean of 150: .27 / sqrt(150) = .022 at most.
    assert np.mean(means, axis=1) == pytest.approx(np.full(5, np.mean(means)), abs=0.08)
    low = np.concatenate([mesh.albedo_low for meshes in drawn for mesh in meshes])
    high = np.concatenate([mesh.albedo_high for meshes in drawn for mesh in meshes])
    assert 0.02 - 1e-6 <= low.min() < 0.04
    assert 0.9 < high.max() <= 0.95 + 1e-6


def test_size_of_a_place_is_not_told_by_its_light(worlds):
    lamps = [len(world.light.lamps) for world in worlds]
    assert min(lamps) == 0 and max(lamps) >= MAX_LAMPS - 1
    kinds = {
        "closed": [w for w in worlds if w.light.indoor and w.light.indoor.opening is None],
        "gap": [w for w in worlds if w.light.indoor and w.light.indoor.opening],
        "sun": [w for w in worlds if w.light.indoor is None and w.light.sun_irradiance > 0],
        "night": [w for w in worlds if w.light.indoor is None and lights.is_dark(w.light)],
    }
    assert {kind: len(found) for kind, found in kinds.items() if len(found) < 3} == {}


def test_light_of_lamps_is_not_hidden_by_their_own_faces(worlds):
    """What hangs or stands elsewhere may hide it; the glowing face behind the lamp must not."""
    for world in worlds[:40]:
        glowing = world.static.corners[world.static.emission > 0]
        for lamp in world.light.lamps:
            if lamp.rides:
                continue
            towards = np.array(lamp.direction)[None]
            assert cast(glowing, np.array(lamp.position_m), towards).min() > 0.1


def test_things_move_tilt_and_float(worlds):
    assert np.mean([bool(world.moving) for world in worlds]) > 0.4
    kinds = set().union(*(world.kinds for world in worlds))
    assert kinds >= {"solid_box", "cylinder", "sphere", "turned_solid", "lump", "panel", "shelf"}
    rng = np.random.default_rng(1)
    boxes = [clutter.solid_box(rng, 1.0) for _ in range(50)]
    level = [len(np.unique(box.corners[..., 2].round(4))) == 2 for box in boxes]
    assert 0.3 < np.mean(level) < 0.7


def test_walls_stand_off_the_way_of_the_ego(worlds):
    for world in worlds[:30]:
        for time in np.linspace(0.0, CLIP.frames_per_clip / CLIP.frame_rate_hz, 3):
            pose = world.ego.at(time)
            level = [(np.cos(a), np.sin(a), 0.0) for a in np.linspace(-np.pi, np.pi, 24)]
            hits = cast(corners_at(world, time), np.array(pose.position_m), np.array(level))
            assert hits.min() > 0.4, world.seed
