"""Zips of stable-baselines3: refused unless they are trusted, and nothing in them is ever run."""

import io
import json
import os
import pickle
import zipfile

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from sb3_contrib import QRDQN, RecurrentPPO
from stable_baselines3 import A2C, DQN, PPO
from torch import nn

from agents.cli.entry import main
from agents.policies import foreign_zips
from agents.policies.learned import load_policy
from shotenv.decision.features import FEATURE_NAMES

COUNT = len(FEATURE_NAMES)
OBSERVED = (np.random.default_rng(0).normal(size=(256, COUNT)) * 2).astype(np.float32)


class Spaces(gym.Env):
    """Has what stable-baselines3 builds a network for."""

    def __init__(self, features=COUNT, actions=3):
        self.observation_space = Box(-2.0, 2.0, (features,), np.float32)
        self.action_space = Discrete(actions)


def saved(path, algorithm=PPO, policy="MlpPolicy", env=None, **form):
    """A model whose actions differ from observation to observation, and its zip."""
    memory = {"buffer_size": 1} if algorithm in (DQN, QRDQN) else {}
    torch.manual_seed(1)
    model = algorithm(policy, env or Spaces(), policy_kwargs=form, device="cpu", **memory)
    for parameter in model.policy.parameters():
        nn.init.normal_(parameter, std=0.3)
    model.save(path)
    return model


@pytest.mark.parametrize(
    ("algorithm", "form", "kind"),
    [
        (PPO, {}, "ppo or a2c"),
        (PPO, {"net_arch": [], "activation_fn": nn.ReLU}, "ppo or a2c"),
        (PPO, {"net_arch": [16], "activation_fn": nn.ReLU}, "ppo or a2c"),
        (A2C, {"net_arch": {"pi": [16, 8, 8], "vf": [4]}}, "ppo or a2c"),
        (DQN, {}, "dqn"),
        (DQN, {"net_arch": [12], "activation_fn": nn.Tanh}, "dqn"),
        (QRDQN, {"n_quantiles": 7, "net_arch": [16]}, "qrdqn"),
    ],
)
def test_what_is_trusted_chooses_as_stable_baselines_does(tmp_path, algorithm, form, kind):
    model = saved(tmp_path / "model.zip", algorithm, **form)
    policy = load_policy(tmp_path / "model.zip", trust=True)
    expected, _ = model.predict(OBSERVED, deterministic=True)
    assert len(np.unique(expected)) > 1
    np.testing.assert_array_equal(policy.act(OBSERVED), expected)
    told = policy.provenance
    assert told.algorithm == f"{kind}, model.zip" and told.power_price is None


class Canary:
    """Unpickled, it leaves a folder."""

    def __init__(self, path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


def rewritten(path, **parts):
    """The same zip with other contents of some names."""
    with zipfile.ZipFile(path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w") as archive:
        for name, value in (content | parts).items():
            archive.writestr(name, value)


def hostile_weights(canary):
    content = io.BytesIO()
    torch.save({"q_net.q_net.0.weight": canary}, content)
    return content.getvalue()


def hostile_told(canary):
    import base64

    told = base64.b64encode(pickle.dumps(canary)).decode()
    return json.dumps({"policy_kwargs": {":type:": "<class 'dict'>", ":serialized:": told}})


def test_without_trust_a_zip_is_refused_with_what_it_can_do(tmp_path, capsys):
    path = tmp_path / "model.zip"
    saved(path)
    rewritten(path, **{"data": hostile_told(Canary(tmp_path / "canary"))})
    with pytest.raises(ValueError, match=r"model\.zip is a file.*run whatever code.*`--trust`"):
        load_policy(path)
    for words in (("evaluate", path), ("export", path), ("play", "--against", path)):
        assert main([*map(str, words)]) == 1
        assert "`--trust` takes it" in capsys.readouterr().err
    assert not (tmp_path / "canary").exists()


def test_pickles_are_not_run_even_in_what_is_trusted(tmp_path):
    path, canary = tmp_path / "model.zip", tmp_path / "canary"
    saved(path)
    rewritten(path, data=hostile_told(Canary(canary)), **{"pytorch_variables.pth": b"\x80\x04."})
    load_policy(path, trust=True)
    rewritten(path, **{"policy.pth": hostile_weights(Canary(canary))})
    with pytest.raises(ValueError, match=r"model\.zip is not a usable zip.*Weights only load"):
        load_policy(path, trust=True)
    assert not canary.exists()
    # Were it unpickled, it would be there: the test can fail.
    pickle.loads(pickle.dumps(Canary(canary)))
    assert canary.exists()


@pytest.mark.parametrize(
    ("made", "says"),
    [
        ({"env": Spaces(features=4)}, "another environment: network maps 4 features to 3 scores"),
        ({"env": Spaces(actions=2)}, f"maps {COUNT} features to 2 scores; expected {COUNT}"),
        ({"activation_fn": nn.ELU}, "activation_fn is .*ELU.*; expected tanh or relu"),
        (
            {"algorithm": RecurrentPPO, "policy": "MlpLstmPolicy"},
            "it has lstm_actor.weight_ih_l0, too; expected the ppo or a2c",
        ),
        ({"net_arch": [2000]}, r"widths \(35, 2000, 3\); expected at most 1024"),
    ],
)
def test_other_networks_are_refused(tmp_path, made, says):
    saved(tmp_path / "model.zip", **made)
    with pytest.raises(ValueError, match=rf"model\.zip.*{says}"):
        load_policy(tmp_path / "model.zip", trust=True)


def packed(tensors):
    content = io.BytesIO()
    torch.save(tensors, content)
    return content.getvalue()


@pytest.mark.parametrize(
    ("weights", "says"),
    [
        ({"actor.mu.weight": torch.ones(3, 35)}, "its network has actor.mu.weight; expected that"),
        ([torch.ones(3)], "something else than named tensors"),
        ({"q_net.q_net.0.weight": torch.ones(3, 35)}, "q_net.q_net.0.bias"),
        (
            {"q_net.q_net.0.weight": torch.full((3, 35), torch.nan),
             "q_net.q_net.0.bias": torch.ones(3)},
            "not all weights are finite",
        ),
        (
            {"q_net.q_net.0.weight": torch.ones(1).expand(10**6, 10**6),
             "q_net.q_net.0.bias": torch.ones(3)},
            r"widths \(1000000, 1000000\)",
        ),
    ],
)  # fmt: skip
def test_damaged_and_hostile_weights_are_refused(tmp_path, weights, says):
    path = tmp_path / "model.zip"
    saved(path, DQN)
    rewritten(path, **{"policy.pth": packed(weights)})
    with pytest.raises(ValueError, match=rf"model\.zip is not a usable zip.*{says}"):
        load_policy(path, trust=True)


def test_what_is_no_zip_or_too_large_is_refused(tmp_path, monkeypatch):
    path = tmp_path / "model.zip"
    path.write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(ValueError, match=r"model\.zip is not a usable zip"):
        load_policy(path, trust=True)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", "{}")
    with pytest.raises(ValueError, match=r"it has no policy\.pth"):
        load_policy(path, trust=True)
    saved(path)
    monkeypatch.setattr(foreign_zips, "LARGEST", 1000)
    with pytest.raises(ValueError, match=r"policy\.pth is larger than 1000 bytes"):
        load_policy(path, trust=True)
