"""Training rewards relative to 4 DCS in the same frame."""

from __future__ import annotations

import numpy as np
import pytest

from agents.policies.guard import ThermalGuard
from agents.training.paired import LOWEST, PairedVecEnv
from agents.training.sb3_vector import Sb3VecEnv
from shotenv.decision.features import FEATURE_NAMES
from shotenv.env.vector import ShotScheduleVectorEnv

DRIVES = 3
OPEN = ThermalGuard(FEATURE_NAMES, (-1e3, -1e3, -1e3))
CLOSED = ThermalGuard(FEATURE_NAMES, (1e3, 1e3, 1e3))


@pytest.fixture
def make(tiny_kwargs):
    def make(adapter, guard=OPEN, **changes):
        kwargs = {**tiny_kwargs, "split": "all", **changes}
        envs = ShotScheduleVectorEnv(DRIVES, autoreset_mode="SameStep", remember=True, **kwargs)
        adapted = PairedVecEnv(envs, guard) if adapter is PairedVecEnv else adapter(envs)
        adapted.seed_all(range(DRIVES))
        adapted.reset()
        return adapted

    return make


def play(env, actions):
    return np.array([env.step(row)[1] for row in actions])


def test_always_4_earns_what_does_not_depend_on_the_frame(make):
    rewards = play(make(PairedVecEnv), np.ones((6, DRIVES), dtype=np.int64))
    np.testing.assert_allclose(rewards, np.broadcast_to(rewards[:1], rewards.shape), atol=1e-6)
    assert (rewards < 0).all()


def test_differences_between_choices_are_those_of_the_true_reward(make):
    random = np.random.default_rng(0)
    one, other = random.integers(0, 3, (2, 6, DRIVES))
    true = play(make(Sb3VecEnv), one) - play(make(Sb3VecEnv), other)
    paired = play(make(PairedVecEnv), one), play(make(PairedVecEnv), other)
    kept = (paired[0] > LOWEST) & (paired[1] > LOWEST)
    assert kept.mean() > 0.5
    np.testing.assert_allclose((paired[0] - paired[1])[kept], true[kept], atol=1e-5)


def test_a_trip_costs_the_floor_in_place_of_many_times_that(make):
    hot = {"laser": {"thermal_resistance_k_per_w": 200.0, "thermal_time_constant_s": 1.0}}
    actions = np.full((12, DRIVES), 2)
    true, rewards = (play(make(kind, **hot), actions) for kind in (Sb3VecEnv, PairedVecEnv))
    assert true.min() < 2 * LOWEST, "nothing tripped"
    assert rewards.min() == np.float32(LOWEST)


def test_guard_stands_between_learner_and_laser(make):
    asked, least = np.full((4, DRIVES), 2), np.zeros((4, DRIVES), dtype=np.int64)
    np.testing.assert_array_equal(
        play(make(PairedVecEnv, CLOSED), asked), play(make(PairedVecEnv), least)
    )
