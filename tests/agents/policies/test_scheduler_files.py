"""A scheduler's folder that somebody changed, mixed or made up: refused by file and reason."""

from __future__ import annotations

import json
import os
import tracemalloc

import pytest
import torch
from pydantic import ValidationError
from safetensors.torch import load_file, save_file
from torch import nn

from agents.policies.learned import NetworkPolicy, load_policy
from agents.policies.recurrent import RecurrentPolicy
from agents.policies.scheduler_files import Provenance, UnboundSchedulerWarning
from agents.policies.score_networks import score_network

NAMES = ("gray_mean", "signal_to_noise", "time_left")
TOLD = Provenance(algorithm="ppo", feature_names=NAMES, power_price=(0.01, 0.3))


def made(seed=0):
    torch.manual_seed(seed)
    return NetworkPolicy(score_network((3, 8, 3), "tanh"), TOLD)


def change(folder, **fields):
    path = folder / "agent.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | fields))


def refusal(folder):
    with pytest.raises(ValueError) as caught:
        load_policy(folder)
    assert type(caught.value) is ValueError and "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("kind", ["plain", "recurrent"])
def test_weights_of_another_training_are_refused(tmp_path, kind):
    def policy(seed):
        torch.manual_seed(seed)
        if kind == "plain":
            return made(seed)
        return RecurrentPolicy(nn.LSTM(3, 4), score_network((4, 3), "tanh"), TOLD)

    for seed, name in enumerate(("one", "other")):
        policy(seed).save(tmp_path / name)
    (tmp_path / "other" / "policy.safetensors").replace(tmp_path / "one" / "policy.safetensors")
    assert "agent.json and policy.safetensors do not belong together" in refusal(tmp_path / "one")


@pytest.mark.parametrize(
    "fields",
    [
        {"feature_names": [NAMES[1], NAMES[0], NAMES[2]]},
        {"activation": "relu"},
        {"power_price": [0.02, 0.3]},
        {"algorithm": "dqn"},
    ],
)
def test_a_changed_description_is_refused(tmp_path, fields):
    made().save(tmp_path)
    change(tmp_path, **fields)
    assert "do not belong together, or one was changed" in refusal(tmp_path)


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"power_price": [0.3, 0.01]}, "power_price: power_price is (0.3, 0.01)"),
        ({"power_price": [-1.0, 0.3]}, "power_price: expected finite prices of at least 0"),
        ({"power_price": [0.1]}, "power_price.1: Field required"),
        ({"power_price": [0.1, 0.2, 0.3]}, "power_price: Tuple should have at most 2"),
        ({"seed": -1}, "seed: Input should be greater than or equal to 0, got -1"),
        ({"seed": 0.5}, "seed: Input should be a valid integer"),
        ({"feature_names": []}, "feature_names: Tuple should have at least 1 item"),
        ({"feature_names": ["power"] * 3}, "feature_names: a name stands twice"),
        ({"feature_names": ['x"; system("rm");', "a", "b"]}, "feature_names.0: String should"),
        ({"layers": [10**9] * 3}, "layers.0: Input should be less than or equal to 1024"),
        ({"layers": [3] * 40}, "layers: Tuple should have at most 16 items"),
        ({"layers": 3}, "layers: Input should be a valid tuple, got 3"),
        ({"versions": {"torch": 2}}, "versions.torch: Input should be a valid string"),
        ({"algorithm": "a" * 10**4}, "algorithm: String should have at most 300"),
    ],
)
def test_each_field_is_checked(tmp_path, fields, says):
    made().save(tmp_path)
    change(tmp_path, **fields)
    told = refusal(tmp_path)
    assert told.startswith(f"{tmp_path / 'agent.json'}: {says}") and len(told) < 600


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('{"schema": 5, "seed": NaN}', "holds NaN, which is no JSON"),
        ("[" * 10**5, "is damaged"),
        ('{"schema": ' + "9" * 10**5 + "}", "is damaged"),
        ("5", "not a table"),
        (" " * (1 << 20) + "{}", "1048578 bytes; expected at most 1048576"),
    ],
)
def test_a_description_that_is_no_such_table_is_refused(tmp_path, text, says):
    made().save(tmp_path)
    (tmp_path / "agent.json").write_text(text)
    told = refusal(tmp_path)
    assert told.startswith(f"{tmp_path / 'agent.json'} is damaged (") and says in told


@pytest.mark.parametrize("name", ["agent.json", "policy.safetensors"])
def test_gigabytes_and_pipes_are_refused_without_reading(tmp_path, name):
    made().save(tmp_path)
    path = tmp_path / name
    with path.open("ab") as file:
        file.truncate(3 << 30)  # Sparse: it takes no space.
    tracemalloc.start()
    try:
        assert "3221225472 bytes; expected at most" in refusal(tmp_path)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 10 << 20
    path.unlink()
    os.mkfifo(path)
    assert str(path) in (told := refusal(tmp_path)) and "not a regular file" in told
    path.unlink()
    path.mkdir()
    assert str(path) in refusal(tmp_path)


@pytest.mark.parametrize("dtype", [torch.complex64, torch.int64, torch.float64, torch.bool])
def test_weights_of_another_type_are_refused(tmp_path, dtype):
    made().save(tmp_path)
    path = tmp_path / "policy.safetensors"
    weights = load_file(path)
    name = next(iter(weights))
    save_file(weights | {name: weights[name].to(dtype)}, path)
    assert f"{path} is not a usable network: {name} is {dtype}; expected" in refusal(tmp_path)


def test_a_folder_of_an_earlier_version_is_read_with_a_warning(tmp_path):
    made().save(tmp_path)
    path = tmp_path / "agent.json"
    content = json.loads(path.read_text())
    del content["digest"]
    path.write_text(json.dumps(content))
    with pytest.warns(UnboundSchedulerWarning, match=r"agent\.json has no digest"):
        loaded = load_policy(tmp_path)
    assert loaded.provenance == TOLD


@pytest.mark.parametrize(
    "fields",
    [
        {"feature_names": ("a b",)},
        {"power_price": (float("nan"), 1.0)},
        {"power_price": (0.1, float("inf"))},
        {"seed": -1},
    ],
)
def test_what_would_be_refused_is_not_saved(fields):
    with pytest.raises(ValidationError):
        Provenance(**{"algorithm": "none", "feature_names": NAMES} | fields)
