"""Close to the trip power has a least price, in what a regression learns and nowhere else."""

import numpy as np
import pytest
import torch

from agents.policies.fixed import FixedPolicy
from agents.training.branching import Branches
from agents.training.heat_price import least_price, with_heat_price
from shotenv.config.keywords import env_config
from shotenv.decision.problem import open_problem

# From cool to warm within a second; eight samples do not trip it before the last kelvins.
NEAR_K = 8.0
HOT = {
    **{"ambient_k": (325.0, 335.0), "release_k": 342.0, "trip_k": 343.0},
    "thermal_time_constant_s": 1.0,
}


def test_the_least_price_falls_in_a_line_from_the_trip():
    margins = np.array([-4.0, 0.0, 0.5, 2.0, 9.0])
    found = least_price(margins, heat_price=0.2, near_k=2.0)
    assert found == pytest.approx([0.2, 0.2, 0.15, 0.0, 0.0])


def test_what_heats_is_worth_less_close_to_the_trip_and_the_same_far_from_it():
    problem = open_problem(env_config("hot", frames_per_drive=24, laser=HOT))
    branches = Branches(problem, [7, 3, 5])
    path = branches.play(FixedPolicy(4), np.full(3, 0.02))
    raised = [
        with_heat_price(state, seen, heat_price=0.2, near_k=NEAR_K)
        for state, seen in zip(path.states, path.observations, strict=True)
    ]
    # Margins as the laser has them, not as they are observed.
    margin_k = torch.stack(
        [
            torch.where(s.laser.tripped, 0.0, HOT["trip_k"] - s.laser.temperature_k)
            for s in path.states
        ]
    ).numpy()
    price = np.maximum(0.02, 0.2 * np.clip(1.0 - margin_k / NEAR_K, 0.0, 1.0))
    got = torch.stack([state.drive.power_price for state in raised]).numpy()
    np.testing.assert_allclose(got, price, rtol=1e-4)
    near = price > 0.02
    assert near.any() and not near.all()

    own, at_least = (
        branches.follow(states, FixedPolicy(4), horizon=1, gamma=1.0)
        for states in (path.states, raised)
    )
    for_eight, raised_for_eight = own[..., 2] - own[..., 0], at_least[..., 2] - at_least[..., 0]
    assert (raised_for_eight[~near] == for_eight[~near]).all()
    assert (raised_for_eight[near] <= for_eight[near]).all()
    assert raised_for_eight[near].mean() < for_eight[near].mean()
