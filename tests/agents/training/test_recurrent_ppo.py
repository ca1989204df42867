"""RecurrentPPO by the trainer of PPO: it learns what needs a memory, and resumes bit for bit."""

import sys

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from safetensors.torch import load_file
from test_training import FRAMES, NAMES, Guess

from agents.config.agent import AgentConfig, PpoConfig, RecurrentConfig
from agents.policies.learned import load_policy
from agents.policies.recurrent import RecurrentPolicy
from agents.training.checkpoint import CHECKPOINT
from agents.training.ppo import PpoTrainer
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.warmup import KnownFrames, warm_start

PPO = PpoConfig(
    total_steps=192,
    num_envs=4,
    drives=32,
    rollout_steps=16,
    batch_size=64,
    epochs=4,
    learning_rate=1e-2,
)
CONFIG = AgentConfig(
    algorithm="recurrent_ppo",
    hidden=(16,),
    seed=3,
    ppo=PPO,
    recurrent=RecurrentConfig(units=16),
)


class Echo(Guess):
    """Pays for answering the sign that the frame before had."""

    def reset(self, **options):
        self._signal = 1.0
        return super().reset(**options)

    def step(self, action):
        reward = float(action == (2 if self._before > 0 else 0))
        observation, _, *others = super().step(action)
        return observation, reward, *others

    def _observe(self):
        self._before = self._signal
        return super()._observe()


def signals():
    """Of 64 drives [FRAMES, 64, 2], and the right answers from the second frame on."""
    seen = np.random.default_rng(0).uniform(-1, 1, (FRAMES, 64, 2)).astype(np.float32)
    return seen, np.where(seen[:-1, :, 0] > 0, 2, 0)


def validate(policy):
    seen, answers = signals()
    policy.reset()
    chosen = np.stack([policy.act(frame) for frame in seen])
    return float(np.mean(chosen[1:] == answers))


def trainer(out, check=validate, config=CONFIG, warm=None):
    envs = SyncVectorEnv([Echo] * config.ppo.num_envs, autoreset_mode=AutoresetMode.SAME_STEP)
    return PpoTrainer(Sb3VecEnv(envs), NAMES, FRAMES, config, check, out, warm)


def test_it_learns_what_no_network_of_the_features_can(tmp_path):
    many = {"total_steps": 8192, "gamma": 0.0, "num_envs": 16, "batch_size": 256}
    longer = CONFIG.model_copy(update={"ppo": PPO.model_copy(update=many)})
    best = trainer(tmp_path, config=longer).run()
    # Without a memory half of the answers are right.
    assert isinstance(best, RecurrentPolicy) and validate(best) > 0.8
    told = load_policy(tmp_path).provenance
    assert told.algorithm == "recurrent_ppo"
    assert told.training["recurrent"] == {"units": 16} and "dqn" not in told.training


def test_interrupted_training_equals_uninterrupted(tmp_path):
    trainer(tmp_path / "whole").run()
    calls = iter(range(100))

    def interrupted(policy):
        if next(calls) == 1:
            raise KeyboardInterrupt
        return validate(policy)

    with pytest.raises(KeyboardInterrupt):
        trainer(tmp_path / "parts", interrupted).run()
    trainer(tmp_path / "parts").run()
    one, two = (load_file(tmp_path / run / CHECKPOINT) for run in ("whole", "parts"))
    assert one.keys() == two.keys() and any("optimizer." in name for name in one)
    assert all(torch.equal(one[name], two[name]) for name in one)


def test_a_warm_start_shows_it_whole_drives(tmp_path):
    seen, answers = signals()
    cost = torch.ones(64, FRAMES, 3)
    drive, frame = np.meshgrid(np.arange(64), np.arange(1, FRAMES), indexing="ij")
    cost[drive, frame, answers.T] = 0.0
    known = KnownFrames(
        torch.from_numpy(seen.swapaxes(0, 1).reshape(-1, 2).copy()), cost.flatten(0, 1), FRAMES
    )

    def warm(network):
        before = network.lstm_critic.weight_hh_l0.clone()
        for seed in range(16):
            warm_start(network, known, seed=seed)
        assert torch.equal(before, network.lstm_critic.weight_hh_l0)

    assert validate(trainer(tmp_path, warm=warm).run()) > 0.9


def test_a_missing_package_is_named_with_its_cure(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "sb3_contrib", None)
    with pytest.raises(ImportError, match=r"recurrent_ppo needs sb3-contrib.*pip install"):
        trainer(tmp_path)
