"""The optimum under a cap: by a price of energy, it is what trying everything finds."""

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from test_optimum import draw_table, warming

from agents.optimum.constrained import (
    MOST_TRIED,
    NARROW,
    PRICE_SPAN,
    bracket,
    constrained_optimum,
    solve,
)
from agents.optimum.outcome_table import play

ENERGY_J = np.array([1.0, 2.0, 4.0])


@pytest.mark.parametrize("cap", [0.02, 0.5, 7.0, 90.0])
def test_prices_next_to_each_other_enclose_the_cap(cap):
    tried = []

    def spent(price):
        tried.append(price)
        return 1.0 / price

    near, dear = bracket(spent, cap, *PRICE_SPAN)
    assert near < dear <= NARROW * near and 1 / near > cap >= 1 / dear
    assert len(tried) <= MOST_TRIED


def test_beyond_its_ends_a_knob_stays_at_them():
    assert bracket(lambda price: 1.0 / price, 1e6, 0.1, 10.0) == (0.1, 0.1)
    assert bracket(lambda price: 1.0 / price, 0.01, 0.1, 10.0) == (10.0, 10.0)


def possible_of(table):
    """As of drives whose actions all cost `ENERGY_J`, whatever the frame."""
    told = torch.from_numpy(np.broadcast_to(ENERGY_J, table.cost.shape).copy())
    return SimpleNamespace(
        table=lambda price: table, outcomes=[SimpleNamespace(laser_energy_j=one) for one in told]
    )


def test_of_cool_drives_the_cap_goes_where_a_joule_saves_most():
    """Without heat frames are independent: the hull of what each may spend, sorted by slope."""
    table = draw_table(1, drives=3, frames=40, heat=(0.0, 0.0, 0.0))
    possible = possible_of(table)
    cap_j = 90.0  # of 40 to 160
    best = constrained_optimum(possible, cap_j)
    shares = np.array(best.shares)
    assert shares @ best.energy_j == pytest.approx(cap_j)
    cost = shares @ [played.cost.mean() for played in best.played]
    # Every frame begins with 2 DCS; steps to more, convex ones, are bought by cost saved per joule.
    steps = []
    for row in table.cost.reshape(-1, 3):
        at = 0
        while at < 2:
            slopes = [
                (row[at] - row[to]) / (ENERGY_J[to] - ENERGY_J[at]) for to in range(at + 1, 3)
            ]
            to = at + 1 + int(np.argmax(slopes))
            steps.append((max(slopes), ENERGY_J[to] - ENERGY_J[at]))
            at = to
    left, saved = 3 * (cap_j - 40.0), 0.0
    for slope, joules in sorted(steps, reverse=True):
        taken = min(left, joules)
        saved, left = saved + max(slope, 0.0) * taken, left - taken
    expected = (table.cost[..., 0].sum() - saved) / 3
    assert cost == pytest.approx(expected, rel=2e-3) and cost >= expected - 1e-9


def test_no_way_that_spends_as_little_costs_less():
    """Of drives that trip, every sequence of actions, one drive alone."""
    table = draw_table(2, drives=1, frames=6)
    best = constrained_optimum(possible_of(table), 12.0)
    for price, played, energy_j in zip(best.prices_per_j, best.played, best.energy_j, strict=True):
        assert price > 0
        for actions in itertools.product(range(3), repeat=6):
            other = play(table, lambda now, actions=actions: np.array([actions[now.frame]]))
            spent = (np.append(ENERGY_J, 0.0)[other.actions]).sum()
            if spent <= energy_j + 1e-9:
                # The grid of temperatures allows for a little.
                assert other.cost[0] >= played.cost[0] - 0.02


def test_a_warm_laser_spends_more_of_its_joules():
    free = draw_table(3, heat=(0.0, 0.0, 0.0), surplus=warming(0.01))
    energy_j = np.broadcast_to(ENERGY_J, free.cost.shape)
    best, spent_j = solve(free, energy_j, 0.1)
    # They begin at 310 K and cool to 300 K, 70 % of the way left each frame.
    surplus = 0.01 * 10.0 * 0.7 ** np.arange(7)
    expected = (ENERGY_J[best.actions] * (1 + surplus)).sum(axis=1).mean()
    assert spent_j == pytest.approx(expected)
