import numpy as np
import pytest

from agents.evaluation.play import make_envs, play_drives
from agents.evaluation.tuning import SideBySide, best_at_prices, mean_returns, tune, tuning_envs
from agents.policies.fixed import CyclePolicy, FixedPolicy, MixturePolicy, RandomPolicy
from agents.policies.looking import LookAndWeighPolicy
from agents.policies.policy import Policy
from agents.policies.practice import PolicyFamily
from shotenv.config.keywords import env_config
from shotenv.decision.features import FEATURE_NAMES

SEEDS = [1000, 1001]
FIXED = PolicyFamily("fixed", lambda names: (FixedPolicy(shots) for shots in (2, 4, 8)))


class Knob(Policy):
    """2 DCS where the observed price of power is above .3, else 8."""

    reads_price = True

    def act(self, observation, info=None):
        share = np.asarray(observation)[..., FEATURE_NAMES.index("power_price")]
        return np.where(share > 0.3 / 0.35, 0, 2)


def test_the_best_return_at_each_price_wins_and_the_first_of_equal_ones():
    candidates = [FixedPolicy(2), FixedPolicy(4), FixedPolicy(8)]
    returns = np.array([[1.0, 2.0, 7.0, 4.0], [0.0, 5.0, 7.0, 3.0], [9.0, 1.0, 6.0, 2.0]])
    best = best_at_prices(candidates, returns, (0.1, 0.4, 0.9, 2.0))
    assert [tuned.policy.action for tuned in best] == [2, 1, 0, 0]
    assert [tuned.mean_return for tuned in best] == [9.0, 5.0, 7.0, 4.0]
    assert [tuned.price for tuned in best] == [0.1, 0.4, 0.9, 2.0]


@pytest.fixture(scope="module")
def envs():
    return make_envs(env_config("default", frames_per_drive=24), "validation", 2, "Disabled")


@pytest.fixture(scope="module")
def many():
    """Of six candidates at a time."""
    return make_envs(env_config("default", frames_per_drive=24), "validation", 12, "Disabled")


def test_returns_at_another_price_are_those_of_a_play_at_it(envs):
    once = play_drives(RandomPolicy(1), envs, SEEDS)
    for price in (0.01, 0.3):
        again = play_drives(RandomPolicy(1), envs, SEEDS, price=price)
        np.testing.assert_allclose(once.returns_at(price), again.per_drive["return"], rtol=1e-9)
        np.testing.assert_allclose(again.power_price, price)
    np.testing.assert_allclose(once.returns_at(0.09), once.per_drive["return"], rtol=1e-9)


def test_candidates_side_by_side_return_what_each_returns_alone(envs, many):
    """With memory, drawn at random, reading the price; more and fewer than play at once."""
    policies = [
        *(CyclePolicy(period) for period in (2, 3, 4, 5, 6, 7)),
        LookAndWeighPolicy(FEATURE_NAMES, 5, 0.2, 0.1),
        MixturePolicy((0.2, 0.3, 0.5), seed=3),
        Knob(),
    ]
    prices, ticks = (0.05, 0.5), []
    together = mean_returns(policies, many, SEEDS, prices, ticks.append)
    alone = [
        [play_drives(one, envs, SEEDS, price=price).per_drive["return"].mean() for price in prices]
        for one in policies
    ]
    np.testing.assert_allclose(together, alone, rtol=1e-9)
    # Seven that do not read the price, six and one of them at once; two that do, twice.
    assert ticks == [6, 1, 2, 2]
    np.testing.assert_allclose(mean_returns(policies, envs, SEEDS, prices), alone, rtol=1e-9)


def test_a_policy_sees_its_own_part_of_the_batch():
    class First(Policy):
        def act(self, observation, info=None):
            return observation[:, 0].astype(np.int64)

    batch = np.array([[2.0], [1.0], [0.0], [1.0]])
    assert SideBySide([FixedPolicy(8), First()], 2).act(batch).tolist() == [2, 2, 0, 1]


def test_the_tuner_on_real_drives_takes_the_best_of_what_it_played(envs):
    dear, free = tune([FIXED], envs, SEEDS, (5.0, 0.0))["fixed"]
    assert dear.policy.action == 0, "power this dear leaves 2 DCS alone"
    assert dear.mean_return == pytest.approx(
        play_drives(FixedPolicy(2), envs, SEEDS, price=5.0).per_drive["return"].mean()
    )
    returns = [
        play_drives(FixedPolicy(shots), envs, SEEDS, price=0.0).per_drive["return"].mean()
        for shots in (2, 4, 8)
    ]
    assert free.policy.action == np.argmax(returns)
    assert free.mean_return == pytest.approx(max(returns))


def test_envs_to_tune_in_are_of_validation_drives():
    envs = tuning_envs(env_config("default", frames_per_drive=4), 1)
    assert envs.problem.config.split == "validation"
    assert tune([FIXED], envs, [7], (0.1,))["fixed"][0].price == 0.1


def test_what_cannot_be_tuned_is_named(envs):
    with pytest.raises(ValueError, match="candidates of family 'none' are none"):
        tune([PolicyFamily("none", lambda names: iter(()))], envs, SEEDS, (0.1,))
    with pytest.raises(ValueError, match="prices is empty"):
        tune([FIXED], envs, SEEDS, ())
    for seeds in ([1, 2, 3, 4], [1, 2, 3], []):
        with pytest.raises(ValueError, match="envs are 2; expected a multiple of the"):
            tune([FIXED], envs, seeds, (0.1,))
