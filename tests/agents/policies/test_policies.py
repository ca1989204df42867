import numpy as np
import pytest
import torch

from agents.policies.fixed import CyclePolicy, FixedPolicy, RandomPolicy
from agents.policies.learned import NetworkPolicy
from agents.policies.rules import SnrThresholdPolicy
from agents.policies.scheduler_files import Provenance

NAMES = ("gray_mean", "signal_to_noise", "time_left")
ONE, BATCH = np.zeros(3, np.float32), np.zeros((5, 3), np.float32)


@pytest.mark.parametrize(("shots", "action"), [(2, 0), (4, 1), (8, 2)])
def test_fixed_policy_asks_for_its_shots(shots, action):
    policy = FixedPolicy(shots)
    assert policy.act(ONE, {}) == action and isinstance(policy.act(ONE, {}), int)
    np.testing.assert_array_equal(policy.act(BATCH, {}), np.full(5, action))


def test_a_dictionary_observation_has_a_batch_too():
    images = {"image": np.zeros((5, 3, 60, 80), np.uint8), "state": BATCH}
    assert FixedPolicy(2).act(images).shape == (5,)


def test_random_policy_draws_all_actions_and_repeats_after_reset():
    policy = RandomPolicy(seed=1)
    drawn = np.concatenate([policy.act(BATCH) for _ in range(200)])
    np.testing.assert_allclose(np.bincount(drawn) / drawn.size, 1 / 3, atol=0.05)
    policy.reset()
    np.testing.assert_array_equal(policy.act(BATCH), drawn[:5])


def test_cycle_starts_with_its_special_frame_and_starts_anew():
    policy = CyclePolicy(3, shots=8, otherwise=4)
    assert [policy.act(ONE) for _ in range(7)] == [2, 1, 1, 2, 1, 1, 2]
    policy.reset()
    np.testing.assert_array_equal(policy.act(BATCH), np.full(5, 2))


def test_rules_say_what_they_do():
    assert str(CyclePolicy(4, shots=8, otherwise=2)) == "8 DCS every 4th frame, else 2"
    assert str(CyclePolicy(2, shots=4, otherwise=2)) == "4 DCS every 2nd frame, else 2"
    said = {period: str(CyclePolicy(period)).split()[3] for period in (3, 11, 12, 13, 21, 22, 113)}
    assert list(said.values()) == ["3rd", "11th", "12th", "13th", "21st", "22nd", "113th"]
    rule = SnrThresholdPolicy(NAMES, 0.25, below=8, above=4)
    assert str(rule) == "8 DCS where signal_to_noise < 0.250, else 4"


def test_threshold_compares_the_named_feature():
    policy = SnrThresholdPolicy(NAMES, 0.25, below=8, above=2)
    observation = np.array([[9, 0.2, 9], [-9, 0.25, -9], [0, 0.3, 0]], np.float32)
    np.testing.assert_array_equal(policy.act(observation), [2, 0, 0])
    assert policy.act(observation[0]) == 2


def test_wrong_arguments_are_named():
    with pytest.raises(ValueError, match="shots is 3; expected 2, 4 or 8"):
        FixedPolicy(3)
    with pytest.raises(ValueError, match="period is 1"):
        CyclePolicy(1)
    with pytest.raises(ValueError, match="no 'signal_to_noise'"):
        SnrThresholdPolicy(("gray_mean",), 0.0, 8, 2)


def test_among_some_actions_a_policy_takes_the_next_lower_and_a_network_its_next_best():
    allowed = np.array([True, True, False])
    cycle = CyclePolicy(2, shots=8, otherwise=2)
    assert [cycle.act_among(np.zeros(3), None, allowed) for _ in range(3)] == [1, 0, 1]
    assert FixedPolicy(8).act_among(np.zeros((2, 3)), None, allowed).tolist() == [1, 1]
    network = torch.nn.Sequential(torch.nn.Linear(1, 3))
    network[0].weight.data.zero_()
    network[0].bias.data = torch.tensor([2.0, 1.0, 3.0])
    told = Provenance(algorithm="none", feature_names=("power",))
    policy = NetworkPolicy(network, told)
    seen = np.zeros((2, 1), np.float32)
    assert policy.act(seen).tolist() == [2, 2]
    assert policy.act_among(seen, None, allowed).tolist() == [0, 0]
