"""The README's code and the examples run as they stand, here with small banks and made samples."""

from __future__ import annotations

import doctest
import importlib.util
import json
import math
import re
import subprocess
import sys
from pathlib import Path

import gymnasium
import pytest
import torch

from agents.policies import NetworkPolicy, Provenance, load_policy, score_network
from shotenv.decision import FEATURE_NAMES
from unwrap import unambiguous_range_m

ROOT = Path(__file__).parents[2]
README = re.findall(
    r"^```python\n(.*?)^```", (ROOT / "README.md").read_text("utf-8"), re.MULTILINE | re.DOTALL
)
F1_HZ = 24e6
WITH_EXAMPLES = sorted(
    path.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".")
    for house in ("unwrap", "shotenv", "agents")
    for path in (ROOT / house).rglob("*.py")
    if ">>> " in path.read_text("utf-8")
)


@pytest.fixture
def small_env(monkeypatch):
    """`gymnasium.make` with short drives."""
    make = gymnasium.make
    monkeypatch.setattr(gymnasium, "make", lambda *a, **k: make(*a, frames_per_drive=3, **k))


def code_with(word: str) -> str:
    """The README's only block of Python that has a word."""
    (code,) = (block for block in README if word in block)
    return code


def test_the_first_lines_of_the_readme_run(small_env, capsys):
    exec(code_with("gym.make("), {})
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 3
    assert all(row.split()[0] in ("0", "2", "4", "8") for row in rows)


def test_the_quickstart_runs(small_env, capsys):
    exec((ROOT / "examples" / "quickstart.py").read_text("utf-8"), {})
    *rows, last = capsys.readouterr().out.splitlines()
    assert len(rows) == 3
    assert re.fullmatch(r"return -?\d+\.\d", last)


def example(name: str):
    """The module of a file in `examples/`."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_the_one_file_ppo_learns_and_is_judged(tiny_kwargs, capsys):
    ppo, environment = example("one_file_ppo"), {**tiny_kwargs, "frames_per_drive": 8}
    small = {"envs": 4, "rollout": 12, "minibatches": 2, "steps": 96, "drives": 2}
    returns = ppo.main(ppo.Config(**small, environment=environment))
    assert set(returns) == {"trained", "always 2", "always 4", "always 8"}
    rows = capsys.readouterr().out.splitlines()
    assert rows[1].startswith("      96 frames") and len(rows) == 2 + 4


@pytest.mark.parametrize("algorithm", ["PPO", "DQN"])
def test_stable_baselines3_learns_through_the_adapter(tiny_kwargs, algorithm):
    environment = {**tiny_kwargs, "frames_per_drive": 8}
    mean = example("stable_baselines").main(algorithm, 64, 2, 2, environment)
    assert math.isfinite(mean)


def test_the_notebook_runs_from_top_to_bottom(monkeypatch, tiny_kwargs, capsys):
    make, small = gymnasium.make, {**tiny_kwargs, "frames_per_drive": 6}
    monkeypatch.setattr(gymnasium, "make", lambda name, **chosen: make(name, **small, **chosen))
    cells = json.loads((ROOT / "examples" / "tour.ipynb").read_text("utf-8"))["cells"]
    names: dict[str, object] = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [], "committed without outputs"
            exec("".join(cell["source"]), names)
    assert "always 8: return" in capsys.readouterr().out


RUNNER = """
import gymnasium
from gymnasium.wrappers.vector import DictInfoToList
single = gymnasium.make({env_id!r})
envs = DictInfoToList(
    gymnasium.make_vec({env_id!r}, 2, vectorization_mode=gymnasium.VectorizeMode.VECTOR_ENTRY_POINT)
)
observations, infos = envs.reset(seed=0)
assert (observations[0] == single.reset(seed=0)[0]).all() and len(infos) == 2
"""


def test_a_runner_of_rllib_finds_the_environment():
    """RLlib is not installed here: what it does with the example's id in a process of its own."""
    source = (ROOT / "examples" / "rllib_ppo.py").read_text("utf-8")
    env_id = example("rllib_ppo").ENV_ID
    assert env_id == "shotenv:shotenv/ShotSchedule-v0" and "VECTOR_ENTRY_POINT" in source
    told = subprocess.run(
        [sys.executable, "-c", RUNNER.format(env_id=env_id)], capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr


class TrainedModule:
    """What the example asks of RLlib's default module, whose actor is `network` times `factor`."""

    def __init__(self, network, factor=1.0):
        self.network, self.factor = network, factor

    def state_dict(self):
        places = {0: "encoder.actor_encoder.net.mlp.0", 2: "encoder.actor_encoder.net.mlp.2"}
        places[4] = "pi.net.mlp.0"
        critic = {"encoder.critic_encoder.net.mlp.0.weight": torch.ones(1, 1)}
        state = self.network.state_dict().items()
        return critic | {f"{places[int(name[0])]}{name[1:]}": value for name, value in state}

    def forward_inference(self, batch):
        return {"action_dist_inputs": self.factor * self.network(batch["obs"])}


def test_a_policy_of_rllib_becomes_a_scheduler(tmp_path):
    rllib = example("rllib_ppo")
    network = score_network((len(FEATURE_NAMES), 8, 8, 3), "tanh")
    module = TrainedModule(network)
    told = Provenance(algorithm="rllib ppo", feature_names=FEATURE_NAMES)
    scheduler = NetworkPolicy(rllib.actor_network(module.state_dict()), told)
    rllib.check(scheduler, module)
    scheduler.save(tmp_path)
    rllib.check(load_policy(tmp_path), module)
    with pytest.raises(ValueError, match="scores differ from RLlib's logits"):
        rllib.check(scheduler, TrainedModule(network, factor=1.1))
    with pytest.raises(ValueError, match="expected an actor of linear layers"):
        rllib.actor_network({"encoder.cnn.weight": torch.ones(1, 1)})


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_in_docstrings_print_what_they_say(name):
    # `...` stands for what differs from version to version, such as the rest of an error's message.
    tried = doctest.testmod(importlib.import_module(name), optionflags=doctest.ELLIPSIS)
    assert tried.failed == 0


@pytest.mark.parametrize("samples", [2, 4])
def test_unwrapping_alone_runs_as_the_readme_says(samples):
    """Samples of a made wall: its depth is right but for whole wraps, which the network tells."""
    wall_m, wrap_m = torch.linspace(1.0, 5.0, 160).expand(1, 120, 160), unambiguous_range_m(F1_HZ)
    angles = torch.tensor([0.0, 0.5, 1.0, 1.5])[:samples, None, None] * math.pi
    made = {
        "dcs": 100 * torch.cos(2 * math.pi * wall_m[:, None] / wrap_m - angles),
        "gray": torch.full((1, 120, 160), 1200, dtype=torch.uint16),
    }
    exec(code_with("load_unwrapper"), made)
    torch.testing.assert_close(made["wrapped_m"], wall_m.contiguous(), atol=1e-3, rtol=0)
    assert made["coarse_m"].shape == wall_m.shape
    wraps = (made["depth_m"] - wall_m) / wrap_m
    torch.testing.assert_close(wraps, wraps.round(), atol=1e-3, rtol=0)
    assert ((made["depth_m"] - made["coarse_m"]).abs() <= wrap_m).all()
