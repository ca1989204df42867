import dataclasses
import itertools

import numpy as np
import pytest

from agents.optimum.choices import (
    always,
    best_choice,
    blind_choices,
    cycle,
    mixture,
    threshold,
    threshold_choices,
)
from agents.optimum.dynamic import clairvoyant, greedy
from agents.optimum.outcome_table import DriveTable, Situation, ThermalState, play

TRIP_K, RELEASE_K, AMBIENT_K, DECAY = 330.0, 325.0, 300.0, 0.7
JUNCTION_DECAY = 0.4


def trip(case_k, rise_k, tripped):
    hot_k = case_k + rise_k
    return ThermalState(case_k, rise_k, np.where(tripped, hot_k > RELEASE_K, hot_k >= TRIP_K))


def one_stage(laser, heat_j):
    """First-order package with a hysteretic trip; one joule heats by one kelvin."""
    case_k = AMBIENT_K + (laser.case_k - AMBIENT_K) * DECAY + heat_j
    return trip(case_k, laser.rise_k, laser.tripped)


def two_stages(laser, heat_j):
    """Half of the heat's effect in a faster stage on top."""
    case_k = AMBIENT_K + (laser.case_k - AMBIENT_K) * DECAY + 0.5 * heat_j
    return trip(case_k, laser.rise_k * JUNCTION_DECAY + 0.5 * heat_j, laser.tripped)


def warming(slope):
    """Electrical energy that grows by `slope` per kelvin above ambient."""
    return lambda temperature_k: slope * (temperature_k - AMBIENT_K)


def draw_table(seed, *, drives=6, frames=7, heat=(3.0, 8.0, 16.0), **changes):
    rng = np.random.default_rng(seed)
    cost = rng.random((drives, frames, 3)) + np.array([0.5, 0.3, 0.0])
    heat_j = np.array(heat) * rng.uniform(0.8, 1.2, (drives, 1))
    table = DriveTable(
        cost=cost,
        reference=cost[..., 1],
        error=cost,
        depth_mae_m=4.0 * cost,
        laser_cost=np.zeros((drives, 3)),
        surplus=warming(0.0),
        dark_cost=np.full((drives, frames), 1.5),
        tripped_cost=np.full((drives, frames), 3.0),
        heat_j=heat_j,
        snr=rng.random(cost.shape),
        start_k=np.full(drives, 310.0),
        span_k=(300.0, 360.0),
        highest_rise_k=0.0,
        advance=one_stage,
        scale=1.0,
        protect=False,
    )
    return dataclasses.replace(table, **changes)


def brute_force(table):
    """Least cost of each drive over all action sequences, one at a time."""
    drives, frames, actions = table.cost.shape
    best = np.full(drives, np.inf)
    for sequence in itertools.product(range(actions), repeat=frames):
        # A cycle as long as the drive is any sequence.
        best = np.minimum(best, play(table, cycle(sequence)).cost)
    return best


@pytest.mark.parametrize("seed", range(3))
def test_dynamic_programming_finds_the_optimum_of_every_sequence(seed):
    table = draw_table(seed, frames=6)
    # So fine a grid never prefers a wrong action: the costs are equal, not close.
    np.testing.assert_allclose(clairvoyant(table, levels=4001).cost, brute_force(table), atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_protects_itself_has_its_optimum_too(seed):
    table = draw_table(seed, frames=6, protect=True)
    found = clairvoyant(table, levels=4001)
    np.testing.assert_allclose(found.cost, brute_force(table), atol=1e-9)
    # Else protection is never asked for, and the test would hold without it.
    assert not np.allclose(found.cost, brute_force(draw_table(seed, frames=6)))


def test_protection_grants_the_next_lower_action_and_never_trips():
    table = draw_table(3, frames=50, protect=True)
    free = dataclasses.replace(table, protect=False)
    assert play(free, always(2)).tripped_share > 0.0
    played = play(table, always(2))
    laser, seen = table.start(), set()
    for frame in range(50):
        taken = played.actions[:, frame]
        trips = table.consequences(laser).tripped
        for drive, action in enumerate(taken):
            assert action < 0 or not trips[drive, action]
            assert trips[drive, action + 1 :].all()
        seen |= set(taken.tolist())
        heat_j = np.where(taken < 0, 0.0, table.heat_j[np.arange(6), taken])
        laser = table.advance(laser, heat_j)
    assert seen == {0, 1, 2}


def test_where_even_the_fewest_samples_would_trip_the_laser_stays_dark():
    table = draw_table(3, frames=30, heat=(14.0, 15.0, 16.0), protect=True)
    played = play(table, always(0))
    dark = played.actions < 0
    assert dark.any() and not dark.all()
    np.testing.assert_allclose(played.frame_cost, np.where(dark, 1.5, table.cost[..., 0]))
    short = draw_table(3, frames=6, heat=(14.0, 15.0, 16.0), protect=True)
    np.testing.assert_allclose(clairvoyant(short, levels=4001).cost, brute_force(short), atol=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_two_stages_have_their_optimum_too(seed):
    highest_k = 0.5 * 16.0 * 1.2 / (1.0 - JUNCTION_DECAY)
    table = draw_table(seed, frames=5, advance=two_stages, highest_rise_k=highest_k)
    best = brute_force(table)
    found = clairvoyant(table, levels=1600, rise_levels=65).cost
    np.testing.assert_allclose(found, best, rtol=1e-3)
    # The second stage matters: the rise alone is worth several kelvin at the trip.
    blind = dataclasses.replace(table, advance=one_stage, highest_rise_k=0.0)
    assert not np.allclose(brute_force(blind), best, rtol=1e-2)


def test_the_optimum_knows_that_a_warm_laser_costs_more():
    extra = np.tile([0.2, 0.4, 0.8], (6, 1))
    table = draw_table(11, frames=5, laser_cost=extra, surplus=warming(0.05))
    found = clairvoyant(table, levels=4001)
    np.testing.assert_allclose(found.cost, brute_force(table), atol=1e-9)
    assert (found.cost > clairvoyant(draw_table(11, frames=5)).cost + 0.1).all()


def test_the_surplus_is_paid_at_the_temperature_of_each_frame():
    extra = np.tile([0.0, 0.0, 2.0], (1, 1))
    table = draw_table(12, drives=1, frames=3, heat=(0, 0, 2), laser_cost=extra)
    dear = dataclasses.replace(table, surplus=warming(0.1))
    laser, expected = table.start(), play(table, always(2)).cost[0]
    for _ in range(3):
        expected += 2.0 * 0.1 * (laser.temperature_k[0] - AMBIENT_K)
        laser = table.advance(laser, table.heat_j[:, 2])
    assert play(dear, always(2)).cost[0] == pytest.approx(expected)


def test_a_look_ahead_pays_where_heat_matters():
    table = draw_table(1, drives=8, frames=60)
    best, guarded = clairvoyant(table).cost, greedy(table, guarded=True).cost
    assert (best <= guarded + 1e-9).all()
    assert best.sum() < 0.98 * guarded.sum()


def test_without_heat_the_optimum_is_greedy():
    table = draw_table(2, frames=40, heat=(0.0, 0.0, 0.0))
    best, short_sighted = clairvoyant(table), greedy(table, guarded=False)
    np.testing.assert_array_equal(best.actions, short_sighted.actions)
    np.testing.assert_allclose(best.cost, table.cost.min(axis=2).sum(axis=1))


def test_the_guard_never_trips_where_it_need_not():
    table = draw_table(3, frames=50)
    assert greedy(table, guarded=False).tripped_share > 0.0
    assert greedy(table, guarded=True).tripped_share == 0.0


def test_a_tripped_laser_stays_off_until_it_has_cooled():
    table = draw_table(4, drives=1, frames=12, heat=(0.0, 0.0, 25.0))
    played = play(table, always(2))
    off = played.actions[0] < 0
    assert off.any() and not off.all()
    expected = np.where(off, 3.0, table.cost[0, :, 2]).sum()
    assert played.cost[0] == pytest.approx(expected)


def test_blind_choices_do_what_their_names_say():
    table = draw_table(5, frames=600, heat=(0.0, 0.0, 0.0))
    shares = {name: play(table, choose).shares for name, choose in blind_choices()}
    np.testing.assert_allclose(shares["always 4"], [0, 1, 0])
    np.testing.assert_allclose(shares["8 every 3 frames, else 2"], [2 / 3, 0, 1 / 3])
    np.testing.assert_allclose(shares["mixture 20%/20%/60% of 2/4/8"], [0.2, 0.2, 0.6], atol=0.03)


def test_no_blind_choice_beats_the_optimum():
    table = draw_table(6, frames=40)
    best = clairvoyant(table).cost
    for _, choose in blind_choices(longest=4):
        assert (play(table, choose).cost >= best - 1e-9).all()


def test_cycle_and_mixture_ignore_the_drive():
    table = draw_table(7)
    now = Situation(4, table.start(), np.zeros(6), table)
    np.testing.assert_array_equal(cycle((2, 0, 0))(now), np.zeros(6))
    np.testing.assert_array_equal(mixture((0.0, 1.0, 0.0))(now), np.ones(6))


def test_threshold_acts_on_what_the_last_acquisition_told():
    table = draw_table(8, heat=(0.0, 0.0, 0.0))
    played = play(table, threshold(0.5, 2, 0))
    assert (played.actions[:, 0] == 2).all(), "nothing was told before the first frame"
    told = np.take_along_axis(table.snr, played.actions[:, :, None], axis=2)[:, :-1, 0]
    np.testing.assert_array_equal(played.actions[:, 1:], np.where(told < 0.5, 2, 0))


def test_tuning_finds_the_rule_that_the_costs_were_made_for():
    table = draw_table(9, drives=8, frames=80, heat=(0.0, 0.0, 0.0))
    # Five frames alike, so that what the last frame told is mostly right for the next.
    snr = np.repeat(
        np.repeat(np.random.default_rng(0).random((8, 16)), 5, axis=1)[:, :, None], 3, 2
    )
    cost = np.where(snr < 0.37, (1.0, 0.5, 0.0), (0.0, 0.5, 1.0))
    table = dataclasses.replace(table, snr=snr, cost=cost)
    rule = best_choice(table, threshold_choices(table))
    assert rule.below == 2 and rule.above == 0
    assert rule.limit == pytest.approx(0.37, abs=0.03)
