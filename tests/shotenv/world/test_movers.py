"""Wheels that roll, limbs that stay hinged, feet that stay where they are set down."""

from dataclasses import dataclass

import numpy as np
import pytest

from shotenv.world.families import forest
from shotenv.world.families.following import walk_across, with_pause
from shotenv.world.geometry.gait import Segment
from shotenv.world.geometry.motion import Arc, Pose, pose_of, rotation
from shotenv.world.geometry.mover import HERE, Along, Rolling, attached, posed
from shotenv.world.geometry.site import Site
from shotenv.world.things import cycles, people, vehicles

CLIP_S = (0.0, 6.4)


@dataclass(frozen=True)
class Rough:
    """A way over rough ground: yaw, pitch and roll change all the time."""

    def at(self, time_s):
        t = time_s
        return Pose(
            (2.0 * t, np.sin(t), 0.1 * t), 0.7 * t, 0.2 * np.sin(3 * t), 0.3 * np.cos(2 * t)
        )

    def way_m(self, time_s):
        return 2.0 * time_s


@pytest.mark.parametrize("pitch", [0.0, 0.4, -2.0, 7.0])
@pytest.mark.parametrize("body", [Pose((1, 2, 3), 0.3, -0.2, 0.5), Pose((1, 2, 3), -2.8, 1.1)])
def test_a_hinged_part_has_the_product_of_both_turns(body, pitch):
    hinge = (0.4, -0.3, 0.9)
    part = attached(body, hinge, pitch)
    product = rotation(body) @ rotation(Pose((0, 0, 0), pitch_rad=pitch))
    assert rotation(part) == pytest.approx(product, abs=1e-12)
    assert part.position_m == pytest.approx(rotation(body) @ hinge + body.position_m, abs=1e-12)


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2, -np.pi / 2, 3.0])
def test_a_pose_is_read_off_its_matrix(pitch):
    turn = rotation(Pose((0, 0, 0), 0.8, pitch, -0.6))
    assert rotation(pose_of(turn, (1.0, 2.0, 3.0))) == pytest.approx(turn, abs=1e-9)


def test_wheels_turn_by_way_over_radius():
    route = Along(Arc(Pose((0, 0, 0), 0.5), 1.0), 0.0, 1.0, (0.0, 3.0, 4.0), (2.0, 2.0, 0.0))
    pieces = vehicles.car(np.random.default_rng(0)).on(route, CLIP_S)
    wheels = [piece.motion for piece in pieces if isinstance(piece.motion, Rolling)]
    assert len(wheels) == 2
    for wheel in wheels:
        for time in (-0.5, 0.3, 1.7, 4.0):
            assert wheel.at(time).pitch_rad == pytest.approx(route.way_m(time) / wheel.radius_m)
        # The point on the ground stands still for a moment.
        contact = []
        for time in (0.5, 0.501):
            back = rotation(wheel.at(0.5)).T @ (0, 0, -wheel.radius_m)
            contact.append(rotation(wheel.at(time)) @ back + wheel.at(time).position_m)
        assert np.linalg.norm(np.subtract(*contact)) < 1e-4


def test_a_route_keeps_its_speed_beyond_its_ends_and_is_smooth_between():
    route = Along(Arc(Pose((0, 0, 0)), 1.0), 1.0, 0.5, (0.0, 1.0, 1.5), (2.0, 2.0, 0.0))
    assert route.way_m(0.5) == pytest.approx(-1.0)
    assert route.way_m(3.0) == pytest.approx(1.5)
    times = np.linspace(0.5, 2.5, 2001)
    speed = np.gradient([route.way_m(time) for time in times], times)
    assert np.abs(np.diff(speed)).max() < 0.02
    assert speed.min() > -1e-3


WALKERS = {
    "adult": (people.adult, 1.3),
    "slow": (people.adult, 0.7),
    "child": (people.child, 1.0),
    "runner": (people.adult, 3.2),
    "dog": (people.dog_walker, 1.1),
    "deer": (forest.deer, 3.0),
    "cyclist": (cycles.cyclist, 4.0),
}


@pytest.mark.parametrize("name", WALKERS)
@pytest.mark.parametrize("rough", [False, True])
def test_limbs_stay_at_their_hinges(name, rough):
    draw, speed = WALKERS[name]
    route = Rough() if rough else Arc(Pose((0, 0, 0), 0.4), speed)
    pieces = draw(np.random.default_rng(1)).on(route, CLIP_S)
    segments = [piece.motion for piece in pieces if isinstance(piece.motion, Segment)]
    hung = 0
    for upper in segments:
        for lower in segments:
            if lower.root_m != upper.root_m or len(lower.above) != len(upper.above) + 1:
                continue
            length, column = lower.above[-1]
            if column != upper.column:
                continue
            hung += 1
            for time in (0.0, 0.813, 2.37, 6.1):
                pose = upper.at(time)
                end = rotation(pose) @ (0.0, 0.0, -length) + pose.position_m
                assert lower.at(time).position_m == pytest.approx(end, abs=1e-6)
    assert hung >= 2


def soles(draw, route, times, seed=3):
    """Lowest corner of each foot or shank [feet, T, 3] and its index [feet, T]."""
    pieces = draw(np.random.default_rng(seed)).on(route, CLIP_S)
    chains = [piece for piece in pieces if isinstance(piece.motion, Segment)]
    longest = max(len(piece.motion.above) for piece in chains)
    feet = [piece for piece in chains if len(piece.motion.above) == longest]
    return [
        np.array([posed(foot.mesh, foot.motion.at(time)).corners.reshape(-1, 3) for time in times])
        for foot in feet
    ]


@pytest.mark.parametrize("name", ["adult", "slow", "child", "runner"])
def test_feet_on_the_ground_do_not_slide(name):
    draw, speed = WALKERS[name]
    times = np.arange(0.5, 4.0, 0.01)
    for foot in soles(draw, Arc(Pose((0, 0, 0), 0.3), speed), times):
        low = foot[..., 2].argmin(axis=1)
        lowest = foot[np.arange(len(times)), low]
        assert lowest[:, 2].min() > -0.01
        grounded = lowest[:, 2] < 1e-3
        assert 0.15 < grounded.mean() < 0.75
        # Corners that touch the ground go nowhere until they are lifted.
        stays = (foot[1:, :, 2] < 1e-3) & (foot[:-1, :, 2] < 1e-3)
        step = np.where(stays, np.linalg.norm(foot[1:] - foot[:-1], axis=-1), 0.0)
        # Of a whole time on the ground: few centimetres, where toes leave and heels land.
        stances = max(1, np.count_nonzero(np.diff(grounded.astype(int)) == 1))
        assert step.sum(axis=0).max() / stances < (0.04 if name == "runner" else 0.025)


@pytest.mark.parametrize("speed", [0.7, 1.0, 1.3, 1.8])
def test_cadence_and_step_length_fit_the_speed(speed):
    times = np.arange(0.0, 6.4, 0.01)
    falls = []
    for foot in soles(people.adult, Arc(Pose((0, 0, 0)), speed), times):
        ahead = foot.mean(axis=1)[:, 0] - speed * times
        turns = np.flatnonzero((ahead[1:-1] > ahead[:-2]) & (ahead[1:-1] >= ahead[2:]))
        falls += [float(np.mean(np.diff(times[turns]))) / 2]
    step_s = np.mean(falls)
    assert 0.45 < speed * step_s < 0.9
    # 1.3 steps/s when strolling, 2.2 when in a hurry.
    assert 1 / step_s == pytest.approx(np.sqrt(speed / 0.384), rel=0.1)


@pytest.mark.parametrize("speed", [0.8, 2.0, 5.0])
def test_animals_go_on_the_ground(speed):
    times = np.arange(0.5, 4.0, 0.01)
    for foot in soles(forest.deer, Arc(Pose((0, 0, 0)), speed), times, 0):
        lowest = foot[..., 2].min(axis=1)
        assert -0.04 < lowest.min() < 0.01
        # Where a foot is lowest it goes back under the body as fast as that goes on.
        down = lowest[:-1] < lowest.min() + 0.01
        passed = np.linalg.norm(np.diff(foot.mean(axis=1), axis=0), axis=1)[down]
        assert np.quantile(passed, 0.3) < 0.5 * speed * 0.01


def test_who_stops_ends_with_both_feet_on_the_ground_and_still():
    site = Site(Arc(Pose((0, 0, 1))), 6.4)
    route = with_pause(site, Arc(Pose((0, 0, 0)), 1.0), 1.4, 2.0, 5.0)
    for seed in range(6):
        for foot in soles(people.adult, route, np.array([2.6, 3.4, 4.6]), seed):
            lowest = foot[:, foot[0, :, 2].argmin()]
            assert lowest[:, 2] == pytest.approx(0.0, abs=0.01)
            assert np.ptp(lowest, axis=0).max() < 0.01


def test_who_stands_sways_a_little_above_feet_that_do_not_move():
    body = people.adult(np.random.default_rng(2)).on(HERE, CLIP_S)
    trunk = np.array([body[0].motion.at(time).position_m for time in np.linspace(0, 6.4, 30)])
    assert 0.005 < np.ptp(trunk[:, 0]) < 0.05
    for foot in soles(people.adult, HERE, np.linspace(0.0, 6.4, 30)):
        assert np.ptp(foot, axis=0).max() < 0.01


def test_who_crosses_stands_walks_and_stands_again():
    site = Site(Arc(Pose((0, 0, 1))), 6.4)
    path = Arc(Pose((5.0, -2.0, 0.0), np.pi / 2), 1.0)
    waits = walk_across(site, path, 1.0, 4.0, 1.4)
    assert waits.way_m(0.9) == 0.0
    assert waits.way_m(6.0) == pytest.approx(4.0, abs=0.02)
    # Under way already when the clip begins.
    late = walk_across(site, path, -1.5, 4.0, 1.4)
    assert 0.5 < late.way_m(0.0) < 1.6
    assert late.way_m(4.0) == pytest.approx(4.0, abs=0.02)
