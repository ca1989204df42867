"""Drives that can be played on from any frame: as the environment plays them, whatever is tried."""

import numpy as np
import pytest

from agents.evaluation.play import make_envs, play_drives
from agents.policies.fixed import FixedPolicy
from agents.policies.rules import SnrThresholdPolicy
from agents.training.branching import Branches
from shotenv.config.keywords import env_config
from shotenv.decision.features import FEATURE_NAMES
from shotenv.decision.problem import open_problem

FRAMES, SEEDS = 24, [7, 3, 5]
RULE = SnrThresholdPolicy(FEATURE_NAMES, 0.4, below=8, above=2)
# Within a second too hot for 8 DCS, in some drives for any.
HOT = {
    **{"ambient_k": (330.0, 340.0), "release_k": 342.0, "trip_k": 343.0},
    "thermal_time_constant_s": 1.0,
}
LASERS = {
    "default": {},
    "hot": {"laser": HOT},
    "unprotected": {"laser": HOT, "protect": False},
    "derated": {"laser": {"derate_k": 310.0, "derate_per_k": 0.02}},
}


@pytest.fixture(scope="module", params=LASERS)
def config(request):
    fields = LASERS[request.param]
    return env_config("hot", frames_per_drive=FRAMES, reward={"power": (0.02, 0.3)}, **fields)


@pytest.fixture(scope="module")
def branches(config):
    return Branches(open_problem(config), SEEDS)


@pytest.fixture(scope="module")
def envs(config):
    return make_envs(config, "train", len(SEEDS), "Disabled")


@pytest.mark.parametrize("policy", [RULE, FixedPolicy(8)])
def test_drives_bring_what_they_bring_in_the_environment(branches, envs, config, policy):
    played = play_drives(policy, envs, SEEDS)
    path = branches.play(policy, played.power_price)
    np.testing.assert_allclose(path.returns, played.reward.sum(axis=1), rtol=1e-12)
    assert path.observations.shape == (FRAMES, len(SEEDS), len(FEATURE_NAMES))
    if config.laser.trip_k == HOT["trip_k"]:
        assert (played.shots == 0).any(), "no laser was off"


def test_prices_are_those_asked_for(branches, envs):
    prices = [0.02, 0.3]
    expected = [play_drives(RULE, envs, SEEDS, price=price).reward.sum(axis=1) for price in prices]
    assert np.ptp(expected, axis=0).max() > 0.1
    assert branches.mean_return(RULE, prices) == pytest.approx(np.mean(expected))
    path = branches.play(RULE, np.array([0.02, 0.3, 0.02]))
    np.testing.assert_allclose(path.returns, [expected[0][0], expected[1][1], expected[0][2]])


@pytest.mark.parametrize(("horizon", "gamma"), [(1, 0.9), (5, 0.9), (2 * FRAMES, 1.0)])
def test_following_the_action_that_was_taken_brings_what_came(branches, envs, horizon, gamma):
    played = play_drives(RULE, envs, SEEDS)
    path = branches.play(RULE, played.power_price)
    worth = branches.follow(path.states, RULE, horizon=horizon, gamma=gamma)
    assert worth.shape == (FRAMES, len(SEEDS), 3)
    for frame in range(FRAMES):
        ahead = played.reward[:, frame : frame + horizon]
        expected = ahead @ gamma ** np.arange(ahead.shape[1])
        taken = worth[frame, np.arange(len(SEEDS)), RULE.act(path.observations[frame])]
        np.testing.assert_allclose(taken, expected, rtol=1e-9, atol=1e-9)


def test_other_actions_bring_what_they_would_have_brought(branches, envs):
    played = play_drives(RULE, envs, SEEDS)
    path = branches.play(RULE, played.power_price)
    worth = branches.follow(path.states[:1], RULE, horizon=FRAMES, gamma=1.0)[0]

    class First(SnrThresholdPolicy):
        """The rule, but for the first frame."""

        action = None

        def act(self, observation, info=None):
            first = np.asarray(observation)[:, FEATURE_NAMES.index("time_left")] == 1.0
            return np.where(first, self.action, super().act(observation, info))

    for action in range(3):
        policy = First(FEATURE_NAMES, 0.4, below=8, above=2)
        policy.action = action
        other = play_drives(policy, envs, SEEDS).reward.sum(axis=1)
        np.testing.assert_allclose(worth[:, action], other, rtol=1e-9)
