"""Traffic that reacts: nothing runs through anything, drivers brake in time, walkers wait."""

import numpy as np
import pytest
from drawn_worlds import EVERY, movers_of, route_of

from shotenv.config.bank import WorldConfig
from shotenv.world.draw import draw_world
from shotenv.world.families.following import (
    HARDEST_BRAKING_M_S2,
    acceleration,
    ahead_of_ego,
    behind_others,
    walk_across,
)
from shotenv.world.geometry.motion import Arc, Pose, rotation
from shotenv.world.geometry.mover import Along
from shotenv.world.geometry.site import Site
from shotenv.world.things import people, vehicles

LONG = WorldConfig(frames_per_clip=64)
LONG_S = LONG.frames_per_clip / LONG.frame_rate_hz
KERB_M, HEAD_M = 0.2, 1.9
"""Heights between which things can be run into."""
SLACK_M = 0.05
"""Taken off a moving thing's rectangle on each side: what is round does not fill it."""


def outlines(pieces, times):
    """Ground rectangles [T, 4, 2] about pieces below `HEAD_M` that turn with their body."""
    result = np.empty((len(times), 4, 2))
    for i, time in enumerate(times):
        body = route_of(pieces[0].motion).at(time)
        turn, place = rotation(Pose((0.0, 0.0, 0.0), body.yaw_rad)), np.array(body.position_m)
        points = np.concatenate(
            [
                piece.mesh.corners.reshape(-1, 3) @ rotation(pose).T + pose.position_m
                for piece in pieces
                for pose in [piece.motion.at(time)]
            ]
        )
        points = ((points - place) @ turn)[(points[:, 2] > KERB_M) & (points[:, 2] < HEAD_M)]
        if not len(points):
            # Too low or too high to be run into: where nothing else could be.
            result[i] = 1e6
            continue
        x0, y0 = points[:, :2].min(axis=0) + SLACK_M
        x1, y1 = points[:, :2].max(axis=0) - SLACK_M
        ring = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
        result[i] = ring @ turn[:2, :2].T + place[:2]
    return result


def height(pieces, times):
    """Highest point of the pieces of what moves, over all times."""
    return max(
        float((piece.mesh.corners.reshape(-1, 3) @ rotation(pose).T + pose.position_m)[:, 2].max())
        for piece in pieces
        for time in times
        for pose in [piece.motion.at(time)]
    )


def meet(a, b):
    """Whether convex shapes [..., N, 2] and [..., M, 2] overlap.

    They are apart where they are so along a normal of one of their sides.
    """
    lead = np.broadcast_shapes(a.shape[:-2], b.shape[:-2])
    a, b = (np.broadcast_to(shape, (*lead, *shape.shape[-2:])) for shape in (a, b))
    sides = np.concatenate([np.roll(shape, -1, axis=-2) - shape for shape in (a, b)], axis=-2)
    normals = np.stack([-sides[..., 1], sides[..., 0]], axis=-1)
    one, other = (normals @ np.swapaxes(shape, -1, -2) for shape in (a, b))
    apart = (one.max(-1) <= other.min(-1)) | (other.max(-1) <= one.min(-1))
    return ~apart.any(axis=-1)


@pytest.mark.parametrize("family", EVERY)
def test_nothing_runs_through_anything(family):
    times = np.linspace(0.0, LONG_S, 45)
    for seed in range(200, 204):
        world = draw_world(family, seed, LONG)
        movers = movers_of(world)
        moving = [outlines(pieces, times) for pieces in movers]
        way = np.array([world.ego.at(time).position_m[:2] for time in times])
        heading = np.array([world.ego.at(time).yaw_rad for time in times])
        ahead = np.stack([np.cos(heading), np.sin(heading)], axis=-1) * 0.4
        beside = np.stack([-np.sin(heading), np.cos(heading)], axis=-1) * 1.0
        ring = [way + i * ahead + j * beside for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        ego = np.stack(ring, axis=1)
        corners = world.static.corners.astype(float)
        z = corners[..., 2]
        # Signs and crowns may hang over a road.
        stands = corners[(z.max(axis=1) > KERB_M) & (z.max(axis=1) < HEAD_M + 1.0)]
        lowest, stands = stands[..., 2].min(axis=1), stands[..., :2]
        for i, (pieces, outline) in enumerate(zip(movers, moving, strict=True)):
            # A pipe over somebody's head is not run into.
            in_reach = stands[lowest < min(HEAD_M, height(pieces, times))]
            assert not meet(outline, ego).any(), (seed, i)
            for j in range(i):
                assert not meet(outline, moving[j]).any(), (seed, i, j)
            for ring in outline:
                away = np.abs(in_reach - ring.mean(axis=0)).min(axis=1).max(axis=1)
                near = in_reach[away < 30.0]
                assert not meet(ring, near).any(), (seed, i)


def site(ego=None, duration_s=12.0):
    return Site(ego or Arc(Pose((0.0, -50.0, 1.0)), 0.0), duration_s)


def profile(path, ways_speeds, step_s=1.0):
    ways, speeds = zip(*ways_speeds, strict=True)
    return Along(path, 0.0, step_s, ways, speeds)


CAR = (-2.2, 2.2)


def test_a_driver_keeps_a_gap_to_one_who_brakes_hard_and_stops_behind():
    place = site()
    # From 12 m/s to a stop within 3 s.
    leader = profile(
        Arc(Pose((30.0, 0.0, 0.0)), 1.0),
        [(0, 12), (12, 12), (24, 12), (34, 8), (40, 4), (42, 0), (42, 0)],
    )
    assert place.put_moving(vehicles.car(np.random.default_rng(0)), leader)
    follower = behind_others(place, Pose((0.0, 0.0, 0.0)), CAR, 0.9, 13.0)
    times = place.times
    rear = place.taken[1][:, 0, 0]
    nose = np.array([follower.at(time).position_m[0] for time in times]) + CAR[1]
    assert (rear - nose).min() > 0.5
    assert (rear - nose)[-1] < 6.0
    speeds = np.array(follower.speeds_m_s)
    slowing = -np.diff(speeds) / np.diff(times)
    assert slowing.max() < 5.0
    assert speeds[-1] < 0.2


def test_a_free_driver_keeps_the_speed_that_is_wished():
    route = behind_others(site(), Pose((0.0, 0.0, 0.0), np.pi), CAR, 0.9, 9.0)
    assert route.speeds_m_s == pytest.approx([9.0] * len(route.speeds_m_s))
    assert route.at(2.0).position_m[0] == pytest.approx(-18.0)


def test_a_driver_stops_for_somebody_who_crosses_and_then_goes_on():
    place = site(duration_s=20.0)
    path = Arc(Pose((40.0, -4.0, 0.0), np.pi / 2), 1.0)
    walk = walk_across(place, path, 1.0, 8.0, 1.2)
    assert place.put_moving(people.adult(np.random.default_rng(0)), walk)
    route = behind_others(place, Pose((0.0, 0.0, 0.0)), CAR, 0.9, 9.0)
    assert place.put_moving(vehicles.car(np.random.default_rng(1)), route)
    speeds = np.array(route.speeds_m_s)
    assert speeds.min() < 4.0
    assert speeds[-1] > 7.0
    assert np.diff(speeds).min() / (place.times[1]) > -HARDEST_BRAKING_M_S2


def test_a_driver_waits_at_a_line_until_it_may_go():
    place = site(duration_s=15.0)
    route = behind_others(place, Pose((0.0, 0.0, 0.0)), CAR, 0.9, 8.0, red=(30.0, 10.0))
    ways = np.array([route.way_m(time) for time in place.times])
    assert ways[place.times < 10.0].max() + CAR[1] < 30.0
    assert ways[-1] > ways[place.times < 10.0].max() + 2.0


def test_a_leader_does_before_what_the_ego_does():
    ego = profile(Arc(Pose((0.0, 0.0, 1.0)), 1.0), [(0, 8), (8, 8), (14, 4), (16, 0), (16, 0)])
    place = site(ego, 4.0)
    path = Arc(Pose((10.0, 0.0, 0.0)), 1.0)
    leader = ahead_of_ego(place, path, 1.0, 0.0, 10.0, 0.0)
    for time in (0.0, 1.0, 2.0, 2.9):
        # Later by the reaction time, the ego is where the leader was, less the first gap.
        gone = ego.way_m(time + 1.0) - ego.way_m(1.0)
        assert leader.way_m(time) == pytest.approx(gone, abs=0.1)
    gaps = [leader.at(t).position_m[0] - ego.at(t).position_m[0] for t in place.times]
    assert min(gaps) > 1.9


def test_acceleration_is_the_intelligent_driver_models():
    assert acceleration(0.0, 10.0, np.inf, 0.0) == pytest.approx(0.73)
    assert acceleration(10.0, 10.0, np.inf, 0.0) == pytest.approx(0.0)
    # At the gap wanted, at no speed, neither pulls.
    assert acceleration(0.0, 10.0, 2.0, 0.0) == pytest.approx(0.0)
    assert acceleration(10.0, 10.0, 1.0, 10.0) == -HARDEST_BRAKING_M_S2


def test_the_same_seed_gives_the_same_ways_bit_for_bit():
    for family in ("overcast_street", "forest_path"):
        poses = [
            [piece.motion.at(time) for piece in draw_world(family, 4, LONG).moving]
            for _ in range(2)
            for time in (-0.3, 0.0, 2.71, 6.4)
        ]
        assert poses[:4] == poses[4:]
