"""Every registered environment keeps the contract of gymnasium and of stable-baselines3."""

from __future__ import annotations

import json
import pickle
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env, data_equivalence
from variants import kwargs_of

import shotenv
from shotenv.config.keywords import env_config

IDS = sorted(name for name in gymnasium.registry if name.startswith("shotenv/"))


@pytest.fixture
def tiny_kwargs(request, tiny_kwargs):
    """Those of the tiny bank, but for held-out families, of which it has no clip."""
    params = getattr(request.node, "callspec", None) and request.node.callspec.params.values()
    named = [value for value in params or () if str(value).startswith("shotenv/")]
    return kwargs_of(named[0], tiny_kwargs) if named else tiny_kwargs


@pytest.fixture(params=IDS)
def env(request, tiny_kwargs):
    made = gymnasium.make(request.param, **tiny_kwargs)
    yield made
    made.close()


def vector_of(name: str, kwargs: dict[str, Any], num_envs: int = 3, **changes: Any):
    return gymnasium.make_vec(name, num_envs, **{**kwargs, **changes})


def features_of(observation: Any) -> np.ndarray:
    return observation["state"] if isinstance(observation, dict) else observation


def arrays_in(thing: Any) -> list[np.ndarray]:
    """All arrays of an observation or an info."""
    if isinstance(thing, dict):
        return [array for part in thing.values() for array in arrays_in(part)]
    return [thing] if isinstance(thing, np.ndarray) else []


class Scalar(gymnasium.RewardWrapper, gymnasium.utils.RecordConstructorArgs):
    """The sum of a reward that is a vector: what checkers of single numbers can read."""

    def __init__(self, env):
        gymnasium.utils.RecordConstructorArgs.__init__(self)
        super().__init__(env)

    def reward(self, reward):
        return float(np.sum(reward))


def test_variants_are_what_their_names_say():
    held_out = gymnasium.make("shotenv/ShotSchedule-Shift-v0").unwrapped
    families = {clip.family for clip in held_out.problem.clips}
    assert families == {"warehouse", "construction_site", "forest_path", "snowy_street"}
    hot = gymnasium.make("shotenv/ShotSchedule-Hot-v0").unwrapped
    assert hot.problem.config == env_config("hot")
    strong = gymnasium.spec("shotenv/ShotSchedule-Strong-v0").kwargs
    config = env_config(**strong)
    assert (config.unwrapper, config.merge, config.eight) == (
        "toffusionnet",
        "none",
        "kernel_density",
    )


@pytest.mark.parametrize("preset", ["hot", "battery", "night_shift", "paper"])
def test_presets_play_drives(preset):
    env = gymnasium.make(shotenv.ENV_ID, config=preset, frames_per_drive=8)
    env.reset(seed=0)
    played = [env.step(action) for action in (2, 1, 0, 2, 2, 0, 1, 2)]
    assert [step[3] for step in played] == [False] * 7 + [True]
    assert all(np.isfinite(step[1]) for step in played)


def test_the_environments_are_registered():
    assert {shotenv.ENV_ID, shotenv.IMAGE_ENV_ID, shotenv.MO_ENV_ID} <= set(IDS)
    # It could not follow `frames_per_drive`, and gymnasium would cut longer drives.
    assert all(gymnasium.spec(name).max_episode_steps is None for name in IDS)


@pytest.mark.parametrize("name", IDS)
# It finds a wrapper around the environment that has no scalar reward.
@pytest.mark.filterwarnings("ignore:.*The environment .* is different from the unwrapped version")
def test_gymnasium_accepts(name, tiny_kwargs):
    # A thinned bank is not drawn.
    mode = None if tiny_kwargs["bank"] == "pocket" else "rgb_array"
    made = gymnasium.make(name, render_mode=mode, **tiny_kwargs)
    checked = Scalar(made.unwrapped) if name == shotenv.MO_ENV_ID else made.unwrapped
    # A thinned bank is not drawn.
    check_env(checked, skip_render_check=tiny_kwargs["bank"] == "pocket")


def test_stable_baselines3_accepts(env):
    from stable_baselines3.common.env_checker import check_env as sb3_check_env

    sb3_check_env(Scalar(env.unwrapped) if "MO" in env.spec.id else env.unwrapped, warn=True)


def episode(env, seed):
    """Features of one episode of random actions."""
    env.action_space.seed(seed)
    observations, truncated = [features_of(env.reset(seed=seed)[0])], False
    while not truncated:
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        assert not terminated
        observations.append(features_of(observation))
    return np.array(observations)


@pytest.mark.parametrize("name", IDS)
def test_no_element_is_constant_over_two_episodes(name, tiny_kwargs):
    # TofFusionNet's own distance, which the tiny bank's network stands for, does not depend on
    # the samples; merging does.
    merged = {"reward": {"power": [0.01, 0.1]}, "merge": "nearest"}
    env = gymnasium.make(name, **merged, **tiny_kwargs)
    seen = np.concatenate([episode(env, 1), episode(env, 2)])
    constant = [
        n for n, v in zip(env.unwrapped.feature_names, seen.T, strict=True) if np.ptp(v) == 0
    ]
    assert not constant


def test_observations_and_infos_share_no_memory(env):
    told = [env.reset(seed=3), *(env.step(action)[::4] for action in (2, 0, 0))]
    kept = [array for step in told for part in step for array in arrays_in(part)]
    copies = [array.copy() for array in kept]
    assert not any(np.shares_memory(one, other) for i, one in enumerate(kept) for other in kept[:i])
    env.step(1)
    assert all(np.array_equal(one, copy) for one, copy in zip(kept, copies, strict=True))
    assert told[1][1]["reward_terms"] is not told[2][1]["reward_terms"]


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("name", IDS)
def test_observations_of_a_vector_share_no_memory(name, mode, tiny_kwargs):
    """Whatever an agent writes into what it is told, nothing later shows it."""
    plain, scribbled = (
        vector_of(name, tiny_kwargs, frames_per_drive=4, autoreset_mode=mode) for _ in "12"
    )
    expected, told = plain.reset(seed=8), scribbled.reset(seed=8)
    kept: list[tuple[Any, Any]] = []
    for action in (2, 0, 1, 1, 0, 2):
        kept.append((expected, pickle.loads(pickle.dumps(expected))))
        for array in arrays_in(told[0]) + arrays_in(told[-1]):
            array[...] = 77 if array.dtype.kind in "uif" else array
        expected, told = (envs.step(np.full(3, action)) for envs in (plain, scribbled))
        assert data_equivalence(expected, told)
    # Nor does a step write into what was given out before.
    assert all(data_equivalence(one, copy) for one, copy in kept)


def test_the_start_is_random_and_seeded(env):
    starts = [features_of(env.reset(seed=seed)[0]) for seed in (0, 1, 2, 0)]
    assert np.array_equal(starts[0], starts[3])
    assert not np.array_equal(starts[0], starts[1])
    assert not np.array_equal(features_of(env.reset()[0]), features_of(env.reset()[0]))


def test_spec_survives_json(env):
    spec = EnvSpec.from_json(env.spec.to_json())
    assert spec.kwargs == json.loads(json.dumps(env.spec.kwargs))
    again = gymnasium.make(spec)
    assert again.spec == env.spec
    assert data_equivalence(again.reset(seed=5), env.reset(seed=5))


@pytest.mark.parametrize("name", IDS)
def test_spec_of_a_vector_survives_json(name, tiny_kwargs):
    envs = vector_of(name, tiny_kwargs)
    again = gymnasium.make_vec(EnvSpec.from_json(envs.spec.to_json()))
    assert again.num_envs == 3
    assert data_equivalence(again.reset(seed=5), envs.reset(seed=5))


@pytest.mark.parametrize("frames", [5, 300])
def test_the_spec_tells_how_long_a_drive_is(frames, tiny_kwargs):
    kwargs = {**tiny_kwargs, "frames_per_drive": frames}
    for name in (shotenv.ENV_ID, shotenv.IMAGE_ENV_ID, shotenv.MO_ENV_ID):
        assert gymnasium.make(name, **kwargs).spec.max_episode_steps == frames
        assert gymnasium.make_vec(name, 2, **kwargs).spec.max_episode_steps == frames
    env = gymnasium.make(shotenv.ENV_ID, **kwargs)
    assert len(episode(env, 0)) == frames + 1


def test_a_vector_cannot_be_cut_short(tiny_kwargs):
    with pytest.raises(ValueError, match="max_episode_steps is 7 and frames_per_drive 32"):
        vector_of(shotenv.ENV_ID, tiny_kwargs, max_episode_steps=7)


def test_the_kind_of_observation_may_be_named(tiny_kwargs):
    image = gymnasium.make(shotenv.ENV_ID, observation="image", **tiny_kwargs)
    by_id = gymnasium.make(shotenv.IMAGE_ENV_ID, **tiny_kwargs)
    assert image.observation_space == by_id.observation_space
    assert set(image.reset(seed=5)[0]) == {"image", "state"}


@pytest.mark.parametrize("remember", [False, True])
@pytest.mark.parametrize("name", IDS)
def test_a_pickled_vector_goes_on_where_it_stopped(name, remember, tiny_kwargs):
    envs = vector_of(name, tiny_kwargs, 2, remember=remember, drives=3, frames_per_drive=4)
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
    assert data_equivalence(env.reset(), twin.reset())


def played_alone(name: str, kwargs: dict[str, Any], seed: int, actions: np.ndarray, mode: str):
    """Steps of a single environment that is reset as a vector's row is with this mode."""
    env = gymnasium.make(name, **kwargs)
    steps, over, reward = [env.reset(seed=seed)], False, 0.0
    for action in actions:
        if over and mode != "SameStep":
            observation, info = env.reset()
            over, reward = False, 0.0 * np.asarray(reward)
        else:
            observation, reward, _, over, info = env.step(int(action))
            if over and mode == "SameStep":
                observation, info = env.reset()
        steps.append((observation, reward, over, info))
    return steps


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("name", IDS)
def test_a_vector_equals_single_environments(name, mode, tiny_kwargs):
    kwargs = {**tiny_kwargs, "frames_per_drive": 4, "drives": 5}
    actions = np.random.default_rng(0).integers(0, 3, (11, 3))
    envs = vector_of(name, kwargs, autoreset_mode=mode)
    alone = [played_alone(name, kwargs, 40 + row, actions[:, row], mode) for row in range(3)]
    told, over = envs.reset(seed=40), np.zeros(3, bool)
    for step in range(len(actions) + 1):
        for row in range(3):
            single = alone[row][step]
            observation = told[0]
            if isinstance(observation, dict):
                observation = {key: part[row] for key, part in observation.items()}
            else:
                observation = observation[row]
            assert data_equivalence(observation, single[0])
            assert row_of(told[-1], row) == row_of_single(single[-1])
            if step:
                assert np.array_equal(told[1][row], single[1])
                assert over[row] == single[2]
        if step == len(actions):
            break
        if over.all() and mode == "Disabled":
            observation, info = envs.reset(options={"reset_mask": over})
            told, over = (observation, 0.0 * told[1], info), np.zeros(3, bool)
        else:
            observation, rewards, _, over, info = envs.step(actions[step])
            told = observation, rewards, info


def row_of(infos: dict[str, Any], row: int) -> dict[str, Any]:
    """Info of one environment as JSON has it, but for the final one."""
    return {
        key: row_of(values, row) if isinstance(values, dict) else values[row].tolist()
        for key, values in infos.items()
        if not key.startswith(("_", "final_"))
    }


def row_of_single(info: dict[str, Any]) -> dict[str, Any]:
    return {
        key: row_of_single(value) if isinstance(value, dict) else np.asarray(value).tolist()
        for key, value in info.items()
    }


@pytest.mark.parametrize("name", IDS)
def test_the_id_may_bring_its_import_along(name, tiny_kwargs):
    """For processes that have not imported the package, such as those that others start."""
    assert gymnasium.make(f"shotenv:{name}", **tiny_kwargs).spec.id == name
    assert gymnasium.make_vec(f"shotenv:{name}", 2, **tiny_kwargs).spec.id == name
