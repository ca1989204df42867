"""Trained schedulers: a plain network whatever trained it, saved and loaded without surprises."""

import json
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3 import DQN, PPO
from stable_baselines3.common.torch_layers import FlattenExtractor
from torch import nn

from agents.policies.learned import NetworkPolicy, Provenance, load_policy
from agents.policies.score_networks import mean_network, rescaled_network, score_network, widths_of

NAMES = ("gray_mean", "signal_to_noise", "time_left")
TOLD = Provenance(
    algorithm="regression", feature_names=NAMES, power_price=(0.005, 0.2), training={"passes": 3}
)
OBSERVED = (np.random.default_rng(0).normal(size=(256, 3)) * 2).astype(np.float32)


def made(layers=(3, 8, 3), activation="tanh", told=TOLD):
    torch.manual_seed(4)
    return NetworkPolicy(score_network(layers, activation), told)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("layers", [(3, 3), (3, 8, 3), (3, 7, 5, 3)])
def test_a_saved_scheduler_scores_the_same(tmp_path, layers, activation):
    policy = made(layers, activation)
    policy.save(tmp_path / "agent")
    loaded = load_policy(tmp_path / "agent")
    np.testing.assert_array_equal(policy.scores(OBSERVED), loaded.scores(OBSERVED))
    chosen = policy.act(OBSERVED)
    assert len(np.unique(chosen)) > 1, "else any network would do"
    np.testing.assert_array_equal(chosen, policy.scores(OBSERVED).argmax(axis=1))
    assert isinstance(loaded.act(OBSERVED[0]), int)
    assert loaded.act({"state": OBSERVED[0]}) == chosen[0]
    assert loaded.provenance == TOLD and loaded.feature_names == NAMES
    said = json.loads((tmp_path / "agent" / "agent.json").read_text())
    assert said["layers"] == list(layers) and said["power_price"] == [0.005, 0.2]


def test_loading_needs_no_stable_baselines(tmp_path):
    made().save(tmp_path)
    code = (
        "import sys; sys.modules['stable_baselines3'] = None; import agents; "
        f"print(agents.load_policy({str(tmp_path)!r}).act([0.0, 0.0, 0.0]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert int(done.stdout) == made().act(np.zeros(3))


class Spaces(gym.Env):
    """Has what stable-baselines3 builds a network for."""

    observation_space = Box(-2.0, 2.0, (3,), np.float32)
    action_space = Discrete(3)


def test_ppo_and_dqn_choose_as_they_do_in_stable_baselines():
    ppo, dqn = PPO("MlpPolicy", Spaces()), DQN("MlpPolicy", Spaces(), buffer_size=1)
    for model, policy in (
        (ppo, NetworkPolicy.from_ppo(ppo.policy, TOLD)),
        (dqn, NetworkPolicy.from_dqn(dqn.q_net, TOLD)),
    ):
        expected, _ = model.predict(OBSERVED, deterministic=True)
        np.testing.assert_array_equal(policy.act(OBSERVED), expected)


class Quantiles(nn.Module):
    """Built and read as sb3-contrib's QuantileNetwork."""

    def __init__(self, n_quantiles):
        super().__init__()
        self.n_quantiles = n_quantiles
        self.features_extractor = FlattenExtractor(Box(-1, 1, (3,)))
        self.quantile_net = nn.Sequential(
            nn.Linear(3, 16), nn.ReLU(), nn.Linear(16, 3 * n_quantiles)
        )

    def forward(self, observation):
        return self.quantile_net(observation).view(-1, self.n_quantiles, 3)


def test_quantiles_are_folded_into_their_mean():
    torch.manual_seed(0)
    network = Quantiles(25)
    drawn = torch.random.get_rng_state()
    policy = NetworkPolicy.from_qr_dqn(network, TOLD)
    assert torch.equal(drawn, torch.random.get_rng_state()), "takes a training run's numbers"
    expected = network(torch.from_numpy(OBSERVED)).mean(dim=1).detach().numpy()
    np.testing.assert_allclose(policy.scores(OBSERVED), expected, atol=1e-6)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("layers", [(3, 3), (3, 8, 3), (3, 7, 5, 3)])
def test_a_mean_network_scores_the_mean_of_its_members(layers, activation):
    torch.manual_seed(1)
    members = [score_network(layers, activation) for _ in range(4)]
    drawn = torch.random.get_rng_state()
    whole = mean_network(members)
    assert torch.equal(drawn, torch.random.get_rng_state()), "takes a training run's numbers"
    assert widths_of(whole) == (3, *(4 * width for width in layers[1:-1]), 3)
    seen = torch.from_numpy(OBSERVED)
    expected = torch.stack([member(seen) for member in members]).mean(dim=0)
    torch.testing.assert_close(whole(seen), expected)
    assert NetworkPolicy(whole, TOLD).activation in (activation, "tanh")


@pytest.mark.parametrize("layers", [(3, 3), (3, 8, 3)])
def test_a_rescaled_network_reads_features_as_they_are(layers):
    torch.manual_seed(1)
    network, seen = score_network(layers, "relu"), torch.from_numpy(OBSERVED)
    mean, spread = torch.tensor([0.5, -1.0, 0.0]), torch.tensor([2.0, 0.1, 1.0])
    before = network(seen)
    whole = rescaled_network(network, mean, spread, 7.0)
    torch.testing.assert_close(
        whole(seen), 7.0 * network((seen - mean) / spread), atol=1e-4, rtol=1e-4
    )
    assert torch.equal(network(seen), before), "changes what it was given"


def test_the_network_is_a_copy():
    network = score_network((3, 8, 3), "relu")
    policy = NetworkPolicy(network, TOLD)
    before = policy.scores(OBSERVED)
    nn.init.zeros_(network[0].weight)
    np.testing.assert_array_equal(before, policy.scores(OBSERVED))


@pytest.mark.parametrize(
    ("network", "says"),
    [
        (nn.Sequential(), "network is empty; expected linear layers"),
        (nn.Sequential(nn.Linear(3, 4), nn.Linear(4, 3)), "network is Linear, Linear; expected"),
        (nn.Sequential(nn.Linear(3, 4), nn.ELU(), nn.Linear(4, 3)), "is Linear, ELU, Linear; exp"),
        (nn.Sequential(nn.Linear(3, 3, bias=False)), "expected linear layers with biases"),
        (nn.Sequential(nn.Linear(2, 3)), "maps 2 features to 3 scores; expected 3 features and 3"),
        (nn.Sequential(nn.Linear(3, 2)), "maps 3 features to 2 scores"),
    ],
)
def test_other_networks_are_refused(network, says):
    with pytest.raises(ValueError, match=says):
        NetworkPolicy(network, TOLD)


def test_a_network_behind_another_network_is_refused():
    network = Quantiles(2)
    network.features_extractor = nn.Linear(3, 3)
    with pytest.raises(ValueError, match="features_extractor is Linear, which has weights"):
        NetworkPolicy.from_qr_dqn(network, TOLD)


def test_an_observation_of_other_features_is_named():
    with pytest.raises(ValueError, match=r"shape \(5, 2\); expected 3 features: gray_mean, sig"):
        made().act(np.zeros((5, 2), np.float32))


def test_missing_and_damaged_schedulers_are_named(tmp_path):
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(ValueError, match=r"agent\.json is missing"):
            load_policy(folder)
    made().save(tmp_path)
    weights = (tmp_path / "policy.safetensors").read_bytes()
    (tmp_path / "policy.safetensors").write_bytes(b"\x80\x04not tensors")
    with pytest.raises(ValueError, match=r"policy\.safetensors is not a usable network"):
        load_policy(tmp_path)
    (tmp_path / "policy.safetensors").write_bytes(weights[:-4] + np.float32(np.nan).tobytes())
    with pytest.raises(ValueError, match=r"policy\.safetensors.*not all weights are finite"):
        load_policy(tmp_path)
    made((3, 9, 3)).save(tmp_path)
    (tmp_path / "policy.safetensors").write_bytes(weights)
    with pytest.raises(ValueError, match=r"policy\.safetensors is not a usable network"):
        load_policy(tmp_path)
    (tmp_path / "agent.json").write_text(json.dumps({"schema": 99}))
    with pytest.raises(ValueError, match="schema 99"):
        load_policy(tmp_path)
    (tmp_path / "agent.json").write_text("{")
    with pytest.raises(ValueError, match="damaged"):
        load_policy(tmp_path)


def without(content, key):
    return {name: value for name, value in content.items() if name != key}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda saved: without(saved, "schema"), "has schema None, but this version"),
        (lambda saved: [saved], r"is damaged \(not a table\); expected the description"),
        (lambda saved: saved | {"schema": 4}, "schema 4, but this version reads 5; train the"),
        (lambda saved: without(saved, "layers"), "layers: Field required; expected what `shotenv"),
        (lambda saved: without(saved, "feature_names"), "feature_names: Field required"),
        (lambda saved: saved | {"mood": 1}, "unknown key mood; expected one of algorithm, feat"),
        (lambda saved: saved | {"activation": "elu"}, "activation: Input should be 'tanh' or"),
        (lambda saved: saved | {"layers": [3, 10**9, 3]}, "layers.1: Input should be less than"),
        (lambda saved: saved | {"feature_names": [1]}, "feature_names.0: Input should be a valid"),
        (
            lambda saved: saved | {"feature_names": list(NAMES[:2])},
            r"and policy\.safetensors do not belong together, or one was changed",
        ),
    ],
)
def test_a_description_that_cannot_be_used_names_file_and_field(tmp_path, change, says):
    made().save(tmp_path)
    path = tmp_path / "agent.json"
    path.write_text(json.dumps(change(json.loads(path.read_text()))))
    with pytest.raises(ValueError, match=rf"agent\.json.*{says}") as caught:
        load_policy(tmp_path)
    assert type(caught.value) is ValueError and str(caught.value).startswith(str(path))
