"""Schedulers with a memory: kept from frame to frame, forgotten at reset, saved without pickle."""

import json

import numpy as np
import pytest
import torch
from sb3_contrib import RecurrentPPO
from test_learned import NAMES, OBSERVED, TOLD, Spaces
from torch import nn

from agents.policies.learned import NetworkPolicy, load_policy
from agents.policies.recurrent import RecurrentPolicy
from agents.policies.score_networks import score_network

FRAMES = OBSERVED.reshape(32, 8, 3)
"""Of 8 drives."""


def made(units=5, layers=(5, 4, 3)):
    torch.manual_seed(7)
    return RecurrentPolicy(nn.LSTM(3, units), score_network(layers, "tanh"), TOLD)


def played(policy, frames=FRAMES):
    return np.stack([policy.scores(frame) for frame in frames])


def test_what_was_seen_counts_until_a_reset():
    policy = made()
    first, again = played(policy), played(policy)
    assert not np.allclose(first[0], again[0]), "remembers nothing"
    policy.reset()
    np.testing.assert_array_equal(played(policy), first)


def test_each_drive_of_a_batch_has_a_memory_of_its_own():
    policy = made()
    together = played(policy)
    for drive in range(8):
        policy.reset()
        np.testing.assert_allclose(played(policy, FRAMES[:, drive]), together[:, drive], atol=1e-6)
    policy.reset()
    assert isinstance(policy.act({"state": FRAMES[0, 0]}), int)
    with pytest.raises(ValueError, match="is of 8 drives, but 1 are remembered; `reset`"):
        policy.act(FRAMES[1])


def test_it_chooses_as_sb3_contrib_does():
    model = RecurrentPPO("MlpLstmPolicy", Spaces(), policy_kwargs={"lstm_hidden_size": 16})
    # Wider than its start, whose actions are nearly as probable as each other.
    nn.init.normal_(model.policy.action_net.weight)
    policy = RecurrentPolicy.from_recurrent_ppo(model.policy, TOLD)
    state, chosen = None, []
    for frame in FRAMES:
        expected, state = model.predict(frame, state, deterministic=True)
        chosen.append(policy.act(frame))
        np.testing.assert_array_equal(chosen[-1], expected)
    assert len(np.unique(chosen)) > 1


def test_a_saved_one_is_loaded_by_the_same_door(tmp_path):
    policy = made()
    policy.save(tmp_path)
    loaded = load_policy(tmp_path)
    assert isinstance(loaded, RecurrentPolicy) and loaded.provenance == TOLD
    np.testing.assert_array_equal(played(loaded), played(policy))
    with pytest.raises(ValueError, match=r"agent\.json: memory: it has an LSTM of 5 units"):
        NetworkPolicy.load(tmp_path)
    NetworkPolicy(score_network((3, 3), "tanh"), TOLD).save(tmp_path)
    with pytest.raises(ValueError, match=r"agent\.json: memory: it has none"):
        RecurrentPolicy.load(tmp_path)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"memory": 10**9}, r"agent\.json: memory: Input should be less"),
        ({"memory": 6}, r"policy\.safetensors is not a usable network"),
        ({"layers": [6, 4, 3]}, r"policy\.safetensors is not a usable network"),
        ({"feature_names": list(NAMES[:2])}, r"policy\.safetensors is not a usable network"),
        ({"feature_names": ["x"] * 2000}, r"agent\.json: feature_names: Tuple should have at most"),
    ],
)
def test_a_description_that_does_not_fit_is_refused(tmp_path, change, says):
    made().save(tmp_path)
    path = tmp_path / "agent.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(ValueError, match=says):
        load_policy(tmp_path)


@pytest.mark.parametrize(
    ("memory", "layers", "says"),
    [
        (nn.LSTM(3, 5, num_layers=2), (5, 3), "expected an LSTM of one layer"),
        (nn.LSTM(2, 5), (5, 3), "memory reads 2 features; expected 3: gray_mean"),
        (nn.LSTM(3, 5), (4, 3), "network maps 4 features to 3 scores; expected 5"),
    ],
)
def test_parts_that_do_not_fit_are_refused(memory, layers, says):
    with pytest.raises(ValueError, match=says):
        RecurrentPolicy(memory, score_network(layers, "tanh"), TOLD)
