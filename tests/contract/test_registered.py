"""Every registered environment keeps the contract of gymnasium and of stable-baselines3."""

from __future__ import annotations

import json
import pickle

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env, data_equivalence

import shotenv  # noqa: F401 - registers the environments

IDS = sorted(name for name in gymnasium.registry if name.startswith("shotenv/"))


@pytest.fixture(params=IDS)
def env(request, tiny_kwargs):
    made = gymnasium.make(request.param, **tiny_kwargs)
    yield made
    made.close()


def test_the_environment_is_registered():
    assert "shotenv/ShotSchedule-v0" in IDS
    assert all(gymnasium.spec(name).max_episode_steps is None for name in IDS)


@pytest.mark.parametrize("name", IDS)
def test_gymnasium_accepts(name, tiny_kwargs):
    made = gymnasium.make(name, render_mode="rgb_array", **tiny_kwargs)
    check_env(made.unwrapped)


def test_stable_baselines3_accepts(env):
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    sb3_check_env(env.unwrapped, warn=True)


def episode(env, seed):
    """Observations of one episode of random actions."""
    env.action_space.seed(seed)
    observations, truncated = [env.reset(seed=seed)[0]], False
    while not truncated:
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert not terminated
        observations.append(observation)
    return np.array(observations)


def test_no_element_is_constant_over_two_episodes(env):
    seen = np.concatenate([episode(env, 1), episode(env, 2)])
    constant = [
        n for n, v in zip(env.unwrapped.feature_names, seen.T, strict=True) if np.ptp(v) == 0
    ]
    assert not constant


def test_observations_and_infos_share_no_memory(env):
    first, _ = env.reset(seed=3)
    copy = first.copy()
    second, _, _, _, info1 = env.step(2)
    _, _, _, _, info2 = env.step(0)
    assert np.array_equal(first, copy)
    assert not np.shares_memory(first, second)
    assert not np.shares_memory(info1["vector_reward"], info2["vector_reward"])
    assert info1["reward_terms"] is not info2["reward_terms"]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("name", IDS)
def test_observations_of_a_vector_share_no_memory(name, mode, tiny_kwargs):
    """Whatever an agent writes into an observation, no later one shows it."""
    kwargs = {**tiny_kwargs, "frames_per_drive": 4}
    plain, scribbled = (gymnasium.make_vec(name, 3, autoreset_mode=mode, **kwargs) for _ in "12")
    expected, observation = plain.reset(seed=8)[0], scribbled.reset(seed=8)[0]
    kept, copies = [expected], [expected.copy()]
    for action in (2, 0, 1, 1, 0, 2):
        observation[:] = np.nan
        expected, observation = (envs.step(np.full(3, action))[0] for envs in (plain, scribbled))
        assert np.array_equal(expected, observation)
        kept.append(expected)
        copies.append(expected.copy())
    # Nor does a step write into an observation that was given out before.
    assert all(np.array_equal(one, copy) for one, copy in zip(kept, copies, strict=True))


def test_the_start_is_random_and_seeded(env):
    starts = [env.reset(seed=seed)[0] for seed in (0, 1, 2, 0)]
    assert np.array_equal(starts[0], starts[3])
    assert not np.array_equal(starts[0], starts[1])
    assert not np.array_equal(env.reset()[0], env.reset()[0])


def test_spec_survives_json(env):
    spec = EnvSpec.from_json(env.spec.to_json())
    assert spec.kwargs == json.loads(json.dumps(env.spec.kwargs))
    again = gymnasium.make(spec)
    assert np.array_equal(again.reset(seed=5)[0], env.reset(seed=5)[0])


def test_the_kind_of_observation_may_be_named(env):
    named = gymnasium.make(EnvSpec.from_json(env.spec.to_json()), observation="features")
    assert np.array_equal(named.reset(seed=5)[0], env.reset(seed=5)[0])


@pytest.mark.parametrize("remember", [False, True])
@pytest.mark.parametrize("name", IDS)
def test_a_pickled_vector_goes_on_where_it_stopped(name, remember, tiny_kwargs):
    envs = gymnasium.make_vec(name, 2, remember=remember, **{**tiny_kwargs, "frames_per_drive": 4})
    envs.reset(seed=4)
    envs.step(np.array([1, 2]))
    twin = pickle.loads(pickle.dumps(envs))
    for action in (2, 0, 1, 1, 2):
        assert data_equivalence(envs.step(np.full(2, action)), twin.step(np.full(2, action)))


def test_a_pickled_environment_goes_on_where_it_stopped(env):
    env.reset(seed=4)
    env.step(1)
    twin = pickle.loads(pickle.dumps(env))
    for action in (2, 0, 1):
        assert data_equivalence(env.step(action), twin.step(action))
    assert np.array_equal(env.reset()[0], twin.reset()[0])
