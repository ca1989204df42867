import numpy as np
import pytest

from agents.evaluation.play import PlayedDrives, make_envs, play_drives
from agents.evaluation.tuning import best_at_prices, tune
from agents.policies.fixed import FixedPolicy, RandomPolicy
from agents.policies.policy import Policy
from agents.policies.practice import PolicyFamily
from shotenv.config.keywords import env_config

SEEDS = [1000, 1001]
REWARD_SCALE = 20.0
# Error and power terms of 2, 4 and 8 DCS: 8 are best below a price of 0.5, 2 above 1.
ERROR, POWER = np.array([0.5, 0.3, 0.1]), np.array([0.4, 0.6, 1.0])


class Knob(Policy):
    """2 DCS where power is dear, else 8."""

    reads_price = True

    def act(self, observation, info=None):
        return np.where(np.asarray(observation)[..., 0] > 0.3, 0, 2)


def made_up_drives(actions, price):
    shape = actions.shape
    per_price = REWARD_SCALE * (POWER[1] - POWER[actions])
    reward = REWARD_SCALE * (ERROR[1] - ERROR[actions]) + price * per_price
    none = np.zeros(shape)
    return PlayedDrives(
        seeds=np.arange(shape[0]),
        shots=np.array([2, 4, 8])[actions],
        reward=reward,
        laser_energy_j=none,
        energy_j=none,
        life_used_h=none,
        depth_mae_m=none,
        wrap_accuracy=none,
        temperature_k=none,
        family=np.full(shape, "garage"),
        clip=none.astype(np.int64),
        power_price=np.full(shape[0], price),
        reward_per_price=per_price,
    )


def test_the_tuner_finds_the_best_candidate_at_each_price():
    asked = []

    def play_at(policy, price):
        asked.append(price)
        own = 0.3 if price is None else price
        action = policy.act(np.full((2, 1), own))
        return made_up_drives(np.repeat(action[:, None], 5, axis=1), own)

    candidates = [FixedPolicy(2), FixedPolicy(4), FixedPolicy(8)]
    best = best_at_prices(candidates, (0.1, 0.4, 0.9, 2.0), play_at)
    # By hand: 0.5 + 0.4 p, 0.3 + 0.6 p, 0.1 + p.
    costs = ERROR + np.outer((0.1, 0.4, 0.9, 2.0), POWER)
    assert [tuned.policy.action for tuned in best] == costs.argmin(axis=1).tolist() == [2, 2, 1, 0]
    expected = 5 * REWARD_SCALE * (costs[:, 1] - costs.min(axis=1))
    np.testing.assert_allclose([tuned.mean_return for tuned in best], expected, atol=1e-9)
    assert asked == [None] * 3, "what does not read the price is played once"
    asked.clear()
    best_at_prices([Knob()], (0.1, 0.4), play_at)
    assert asked == [0.1, 0.4]


def test_no_candidate_is_named():
    with pytest.raises(ValueError, match="candidates is empty"):
        best_at_prices([], (0.1,), lambda policy, price: None)


@pytest.fixture(scope="module")
def envs():
    return make_envs(env_config("default", frames_per_drive=24), "validation", 2, "Disabled")


def test_returns_at_another_price_are_those_of_a_play_at_it(envs):
    once = play_drives(RandomPolicy(1), envs, SEEDS)
    for price in (0.01, 0.3):
        again = play_drives(RandomPolicy(1), envs, SEEDS, price=price)
        np.testing.assert_allclose(once.returns_at(price), again.per_drive["return"], rtol=1e-9)
        np.testing.assert_allclose(again.power_price, price)
    np.testing.assert_allclose(once.returns_at(0.09), once.per_drive["return"], rtol=1e-9)


def test_the_tuner_on_real_drives_takes_the_best_of_what_it_played(envs):
    family = PolicyFamily("fixed", lambda names: (FixedPolicy(shots) for shots in (2, 4, 8)))
    (best,) = tune([family], envs, SEEDS, (5.0,))["fixed"]
    assert best.policy.action == 0, "power this dear leaves 2 DCS alone"
    assert best.mean_return == pytest.approx(
        play_drives(FixedPolicy(2), envs, SEEDS, price=5.0).per_drive["return"].mean()
    )
    free = tune([family], envs, SEEDS, (0.0,))["fixed"][0]
    returns = {
        shots: play_drives(FixedPolicy(shots), envs, SEEDS, price=0.0).per_drive["return"].mean()
        for shots in (2, 4, 8)
    }
    assert free.mean_return == pytest.approx(max(returns.values()))
