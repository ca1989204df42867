"""What every action would have brought: what it does bring in an environment that takes it."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import shotenv
from shotenv.env.counterfactuals import TOLD


@pytest.fixture
def hot(tiny_kwargs):
    """Drives in which the laser trips: what an action brings depends on those before."""
    laser = {"trip_k": 318.0, "release_k": 314.0, "ambient_k": [304.15, 310.15]}
    return {**tiny_kwargs, "laser": laser, "protect": False, "frames_per_drive": 60}


@pytest.mark.parametrize("remember", [False, True])
def test_each_outcome_is_what_the_action_brings(hot, remember):
    env = gymnasium.make(shotenv.ENV_ID, outcomes=True, remember=remember, **hot)
    others = [gymnasium.make(shotenv.ENV_ID, **hot) for _ in range(3)]
    _, start = env.reset(seed=2)
    before, shots = [], set()
    for action in np.random.default_rng(0).integers(0, 3, 12).tolist():
        *_, info = env.step(action)
        for tried, other in enumerate(others):
            other.reset(seed=2)
            for earlier in before:
                other.step(earlier)
            _, reward, _, _, expected = other.step(tried)
            outcomes = info["outcomes"]
            assert outcomes["reward"][tried] == reward
            assert all(np.array_equal(outcomes[name][tried], expected[name]) for name in TOLD)
        before.append(action)
        shots |= set(info["outcomes"]["shots"].tolist())
    assert shots >= {2, 4, 8}
    assert {k: np.shape(v) for k, v in start["outcomes"].items()} == {
        k: np.shape(v) for k, v in info["outcomes"].items()
    }


def test_telling_changes_nothing_else(hot):
    plain, telling = (gymnasium.make(shotenv.ENV_ID, outcomes=o, **hot) for o in (False, True))
    plain.reset(seed=1)
    telling.reset(seed=1)
    for action in (2, 0, 1):
        left, right = plain.step(action), telling.step(action)
        del right[4]["outcomes"]
        assert data_equivalence(left, right)


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_a_vector_tells_as_single_environments_do(tiny_kwargs, mode):
    kwargs = {**tiny_kwargs, "frames_per_drive": 3, "outcomes": True}
    envs = gymnasium.make_vec(shotenv.ENV_ID, 2, autoreset_mode=mode, **kwargs)
    env = gymnasium.make(shotenv.ENV_ID, **kwargs)
    envs.reset(seed=5)
    env.reset(seed=5)
    for _ in range(3):
        *_, infos = envs.step(np.array([2, 0]))
        *_, info = env.step(2)
        told = infos.get("final_info", infos)["outcomes"]
        for name, values in info["outcomes"].items():
            assert np.array_equal(told[name][0], values)
    # After the end there are new drives, of which nothing is known yet.
    if mode == "NextStep":
        *_, infos = envs.step(np.array([2, 0]))
    assert not infos["outcomes"]["shots"].any()
