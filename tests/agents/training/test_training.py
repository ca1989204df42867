import ast
import math
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from safetensors.torch import load_file

import agents
from agents.config.agent import AgentConfig, PpoConfig
from agents.policies.learned import NetworkPolicy
from agents.training.checkpoint import CHECKPOINT
from agents.training.ppo import PpoTrainer
from agents.training.sb3_vector import Sb3VecEnv, split_infos
from shotenv.config.keywords import env_config

AGENTS = Path(agents.__file__).parent
FRAMES = 16
NAMES = ("signal", "heat_margin")


class Guess(gym.Env):
    """Pays 1 for answering the sign of its first element with action 0 or 2; ends by time."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (2,), np.float32)
    action_space = gym.spaces.Discrete(3)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self._frame = 0
        return self._observe(), {"frame": 0}

    def step(self, action):
        reward = float(action == (2 if self._signal > 0 else 0))
        self._frame += 1
        return self._observe(), reward, False, self._frame == FRAMES, {"frame": self._frame}

    def _observe(self):
        self._signal = self.np_random.uniform(-1, 1)
        return np.array([self._signal, 1 - self._frame / FRAMES], np.float32)


def make_envs(count=4, mode=AutoresetMode.SAME_STEP):
    return SyncVectorEnv([Guess] * count, autoreset_mode=mode)


PPO = PpoConfig(total_steps=320, num_envs=4, drives=32, rollout_steps=16, batch_size=64, epochs=4)
CONFIG = AgentConfig(hidden=(16,), seed=3, ppo=PPO)


def changed(**fields):
    """`CONFIG` with other fields of PPO."""
    return CONFIG.model_copy(update={"ppo": PPO.model_copy(update=fields)})


def validate(policy: NetworkPolicy) -> float:
    observation = np.random.default_rng(0).uniform(-1, 1, (256, 2)).astype(np.float32)
    return float(np.mean(policy.act(observation) == np.where(observation[:, 0] > 0, 2, 0)))


def make_trainer(out, *, check=validate, config=CONFIG):
    return PpoTrainer(Sb3VecEnv(make_envs()), NAMES, FRAMES, config, check, out)


def test_adapter_reports_the_end_of_an_episode_as_sb3_expects():
    envs = Sb3VecEnv(make_envs())
    envs.seed_all([1, 2, 3, 4])
    first = envs.reset().copy()
    assert [info["frame"] for info in envs.reset_infos] == [0] * 4
    for _ in range(FRAMES):
        observations, rewards, dones, infos = envs.step(np.zeros(4, int))
    assert dones.all() and rewards.dtype == np.float32
    for info, fresh in zip(infos, observations, strict=True):
        assert info["TimeLimit.truncated"] is True and info["frame"] == FRAMES
        assert info["terminal_observation"][1] == 0.0 and fresh[1] == 1.0
    envs.seed_all([1, 2, 3, 4])
    np.testing.assert_array_equal(envs.reset(), first)
    assert (envs.reset() != first).any(), "seeds count once"


def test_adapter_seeds_its_environments_in_turn():
    envs, others = Sb3VecEnv(make_envs()), Sb3VecEnv(make_envs())
    envs.seed(7)
    others.seed_all([7, 8, 9, 10])
    np.testing.assert_array_equal(envs.reset(), others.reset())
    assert len(envs.get_attr("num_envs")) == 4
    assert (
        envs.get_attr("num_envs", 2) == [4] and len(envs.env_is_wrapped(gym.Wrapper, [0, 3])) == 2
    )


def test_nothing_reaches_into_private_parts_of_others():
    """An attribute `_name` belongs to the object that has it: only `self` and `cls` use it."""
    reached = [
        f"{path.relative_to(AGENTS)}:{node.lineno} {ast.unparse(node)}"
        for path in AGENTS.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute) and re.match(r"_[^_]", node.attr)
        if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls"))
    ]
    assert reached == []


def test_adapter_refuses_other_autoreset_modes():
    with pytest.raises(ValueError, match="needs SameStep"):
        Sb3VecEnv(make_envs(mode=AutoresetMode.NEXT_STEP))


def test_infos_are_split_by_their_masks():
    infos = {
        "shots": np.array([2, 8]),
        "_shots": np.array([True, False]),
        "terms": {"error": np.array([0.1, 0.2]), "_error": np.array([True, True])},
        "_terms": np.array([False, True]),
    }
    assert split_infos(infos, 2) == [{"shots": 2}, {"terms": {"error": 0.2}}]


def test_training_learns_and_keeps_the_best_policy(tmp_path):
    returns = []
    config = changed(total_steps=1536, learning_rate=1e-2)

    def check(policy):
        returns.append(validate(policy))
        return returns[-1]

    best = make_trainer(tmp_path, check=check, config=config).run()
    assert validate(best) == max(returns) > 0.9
    assert {path.name for path in tmp_path.iterdir()} == {
        *(CHECKPOINT, "policy.safetensors", "agent.json")
    }


def test_interrupted_training_equals_uninterrupted(tmp_path):
    whole = make_trainer(tmp_path / "whole").run()
    calls = iter(range(100))

    def interrupted(policy):
        if next(calls) == 2:
            raise KeyboardInterrupt
        return validate(policy)

    # In the third validation: after a round that no checkpoint holds yet.
    with pytest.raises(KeyboardInterrupt):
        make_trainer(tmp_path / "parts", check=interrupted).run()
    resumed = make_trainer(tmp_path / "parts").run()
    for name, tensor in whole.network.state_dict().items():
        assert torch.equal(tensor, resumed.network.state_dict()[name]), name
    one, two = (load_file(tmp_path / run / CHECKPOINT) for run in ("whole", "parts"))
    assert one.keys() == two.keys() and any(name.startswith("optimizer.") for name in one)
    assert all(torch.equal(one[name], two[name]) for name in one)


def test_checkpoints_of_other_runs_and_damaged_ones_are_refused(tmp_path):
    make_trainer(tmp_path).run()
    other = changed(gamma=0.5)
    with pytest.raises(ValueError, match="another configuration"):
        make_trainer(tmp_path, config=other).run()
    # What a pickle begins with: nothing may try to read it as one.
    (tmp_path / CHECKPOINT).write_bytes(b"\x80\x04.")
    with pytest.raises(ValueError, match=r"checkpoint\.safetensors is damaged"):
        make_trainer(tmp_path).run()


def test_a_checkpoint_that_does_not_fit_into_the_memory_is_named(tmp_path, monkeypatch):
    make_trainer(tmp_path).run()

    def full(*_, **__):
        raise MemoryError("Cannot allocate memory (os error 12)")

    monkeypatch.setattr("agents.training.checkpoint.safe_open", full)
    with pytest.raises(ValueError, match=r"checkpoint\.safetensors is damaged, or too large"):
        make_trainer(tmp_path).run()


def test_checkpoints_of_other_prices_are_refused(tmp_path):
    make_trainer(tmp_path).run()
    with pytest.raises(ValueError, match="another configuration"):
        PpoTrainer(
            *(Sb3VecEnv(make_envs()), NAMES, FRAMES, CONFIG, validate, tmp_path),
            env=env_config(reward={"power": (0.01, 0.2)}),
        ).run()


@pytest.mark.parametrize(
    ("price", "says"),
    [((0.2, 0.1), "low <= high"), ((0.0, 0.1), "above 0"), ((0.1, math.inf), "at most")],
)
def test_impossible_prices_are_refused(price, says):
    with pytest.raises(ValueError, match=f"power_price is .*{says}"):
        AgentConfig(power_price=price)
