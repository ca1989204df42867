"""A start for PPO: the actor learns what is known, nothing else changes, and drives line up."""

import numpy as np
import pytest
import torch
from gymnasium.spaces import Box, Discrete
from stable_baselines3.common.policies import ActorCriticPolicy
from test_training import CONFIG, FRAMES, NAMES, make_envs, validate

from agents.evaluation.play import make_envs as make_shotenv, play_drives
from agents.policies.fixed import FixedPolicy
from agents.policies.learned import NetworkPolicy, Provenance
from agents.training.ppo import PpoTrainer
from agents.training.sb3_vector import Sb3VecEnv
from agents.training.warmup import ROLLOUTS, KnownFrames, known_frames, warm_start
from shotenv.config.keywords import env_config
from shotenv.decision.features import SCENE_FEATURES

TOLD = Provenance(algorithm="warm start", feature_names=NAMES)


def untrained():
    return ActorCriticPolicy(
        Box(-np.inf, np.inf, (2,), np.float32), Discrete(3), lambda _: 1e-3, net_arch=[16]
    )


@pytest.fixture
def known():
    """Frames of the guessing game: the answer to the sign of the first element costs nothing."""
    observations = 2 * torch.rand(16384, 2, generator=torch.Generator().manual_seed(0)) - 1
    cost = torch.ones(16384, 3)
    cost[torch.arange(16384), torch.where(observations[:, 0] > 0, 2, 0)] = 0.0
    return KnownFrames(observations, cost)


def test_the_actor_learns_the_cheapest_actions_and_the_critic_stays(known):
    torch.manual_seed(0)
    network = untrained()
    before = {name: value.clone() for name, value in network.state_dict().items()}
    assert validate(NetworkPolicy.from_ppo(network, TOLD)) < 0.8
    warm_start(network, known, seed=0)
    assert validate(NetworkPolicy.from_ppo(network, TOLD)) > 0.95
    after = network.state_dict()
    kept = {name for name in before if torch.equal(before[name], after[name])}
    assert kept == {name for name in before if "value" in name}
    again = untrained()
    again.load_state_dict(before)
    warm_start(again, known, seed=0)
    assert all(torch.equal(again.state_dict()[name], after[name]) for name in after)


def test_a_run_starts_warm_once_and_never_ends_worse(tmp_path, known):
    warmed = []

    def warm(network):
        warmed.append(network)
        warm_start(network, known, seed=0)

    def trainer():
        return PpoTrainer(Sb3VecEnv(make_envs()), NAMES, FRAMES, CONFIG, validate, tmp_path, warm)

    assert validate(trainer().run()) > 0.95
    assert validate(trainer().run()) > 0.95
    assert len(warmed) == 1


def test_known_costs_are_those_of_the_frames_they_stand_beside(
    tiny_kwargs, session_cache, monkeypatch
):
    monkeypatch.setenv("SHOTENV_CACHE", session_cache)
    config, seeds = env_config(**tiny_kwargs), [3, 4]
    envs = make_shotenv(config, "train", len(seeds), "Disabled")
    ticks = []
    known = known_frames(envs, seeds, tick=ticks.append)
    frames = config.frames_per_drive
    shape = ROLLOUTS, len(seeds), frames
    assert len(known.observations) == len(known.cost) == np.prod(shape)
    assert sum(ticks) == (1 + ROLLOUTS) * len(seeds) * frames
    # What is seen of the scene does not depend on what was chosen.
    scene = known.observations.reshape(*shape, -1)[..., : len(SCENE_FEATURES)]
    assert torch.equal(scene[0], scene[1]) and not torch.equal(scene[:, 0], scene[:, 1])
    played = play_drives(FixedPolicy(2), envs, seeds)
    cost = known.cost.reshape(*shape, 3)[0, ..., 0].numpy()
    assert (played.shots == 2).all()
    # Rewards are relative to 4 DCS, which no choice changes, and scaled.
    four = known.cost.reshape(*shape, 3)[0, ..., 1].numpy()
    expected = config.reward.scale * (four - cost)
    np.testing.assert_allclose(played.reward, expected, rtol=1e-4, atol=1e-5)
