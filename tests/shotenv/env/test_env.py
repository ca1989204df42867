"""The gymnasium faces: configuration, errors, infos, auto-reset, pictures."""

from __future__ import annotations

import json
import shutil

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import shotenv
from shotenv.decision.rewards import TERMS

TOLD = {
    "shots",
    "energy_j",
    "laser_energy_j",
    "duty",
    "power_w",
    "temperature_k",
    "depth_mae_m",
    "depth_rmse_m",
    "wrap_accuracy",
    "valid_share",
    "within_0p1m",
    "reward_terms",
    "vector_reward",
    "cost",
}


def make(kwargs, **changes):
    return gymnasium.make(shotenv.ENV_ID, **{**kwargs, **changes})


def make_vec(kwargs, num_envs=3, **changes):
    return gymnasium.make_vec(shotenv.ENV_ID, num_envs=num_envs, **{**kwargs, **changes})


def test_a_step_tells_what_it_cost(tiny_kwargs):
    env = make(tiny_kwargs, reward={"power": 0.2, "scale": 5.0}, outcomes=True)
    env.reset(seed=0)
    weights = env.unwrapped.problem.config.reward
    weighed = np.array([weights.error, weights.duty, 0.2, weights.trip])
    for action, shots in ((0, 2), (1, 4), (2, 8)):
        _, reward, _, _, info = env.step(action)
        assert set(info) >= TOLD
        assert info["shots"] == info["asked"] == shots
        terms = [info["reward_terms"][name] for name in TERMS]
        assert info["vector_reward"] in env.unwrapped.reward_space
        assert np.allclose(info["vector_reward"], terms)
        # What the choice is worth is what its terms weigh less than another's in the same frame.
        outcomes = info["outcomes"]
        saved = weighed @ outcomes["vector_reward"][1] - weighed @ terms
        assert reward - outcomes["reward"][1] == pytest.approx(5.0 * saved, abs=1e-5)


def test_a_film_plays_in_real_time(tiny_kwargs, tiny_bank, tmp_path):
    slow = shutil.copytree(tiny_bank, tmp_path / "slow")
    manifest = json.loads((slow / "manifest.json").read_text())
    manifest["config"]["world"]["frame_rate_hz"] = 4.0
    del manifest["digest"]
    (slow / "manifest.json").write_text(json.dumps(manifest))
    changes = {"bank": str(slow), "frame_rate_hz": 4.0}
    assert make(tiny_kwargs, **changes).metadata["render_fps"] == 4
    assert make_vec(tiny_kwargs, **changes).metadata["render_fps"] == 4
    assert make(tiny_kwargs).metadata["render_fps"] == 10


def test_a_drive_is_truncated_and_then_wants_a_reset(tiny_kwargs):
    env = make(tiny_kwargs, frames_per_drive=5).unwrapped
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(0)
    env.reset(seed=0)
    flags = [env.step(1)[2:4] for _ in range(5)]
    assert flags == [(False, False)] * 4 + [(False, True)]
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(0)


@pytest.mark.parametrize("action", [3, -1, 1.0, True, None, "2", [1], np.array([0, 1])])
def test_a_wrong_action_is_named(tiny_kwargs, action):
    env = make(tiny_kwargs).unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"^action is .*; expected 0 \(2 DCS\), 1 \(4 DCS\)"):
        env.step(action)


@pytest.mark.parametrize("actions", [[0, 1], [0, 1, 3], [0.0, 1.0, 2.0], 1])
def test_wrong_actions_of_a_vector_are_named(tiny_kwargs, actions):
    env = make_vec(tiny_kwargs)
    env.reset(seed=0)
    with pytest.raises(ValueError, match="actions are"):
        env.step(actions)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"colour": 1}, "colour"),
        ({"reward": {"power": -1}}, "reward: power is"),
        ({"reward": {"power": [0.2, 0.01]}}, r"power is \(0.2, 0.01\); expected low <= high"),
        ({"reward": {"energy": 1}}, r"unknown key reward\.energy; expected one of error, duty"),
        (
            {"reward": {"speed": 1}},
            r"unknown key reward\.speed; expected one of error, duty",
        ),
        ({"reward": {"error_scale_m": "50 cm"}}, "error_scale_m"),
        ({"sensor": "epc999"}, "epc999"),
        ({"sensor": {"f1_hz": 30e6}}, "f1_hz"),
        ({"sensor": 3}, "sensor"),
        ({"laser": {"trip_k": 300.0}}, "release_k"),
        ({"laser": {"efficiency": float("nan")}}, "efficiency"),
        ({"split": "tests"}, "split"),
        ({"bank": "no-such-bank"}, "no-such-bank"),
        ({"unwrapper": "no-such-net"}, "no-such-net"),
        ({"merge": "ceil"}, "merge"),
        (
            {"observation": "film"},
            "observation is 'film'; expected one of features, image",
        ),
        ({"drives": 0}, "drives is 0"),
        ({"drives": True}, "drives is True"),
        ({"frames_per_drive": 0}, "frames_per_drive"),
        ({"frame_rate_hz": 100.0}, "frame_rate_hz"),
        ({"config": "no-such-config"}, "no-such-config"),
        ({"render_mode": "ansi"}, "render_mode is 'ansi'; expected one of rgb_array, human"),
    ],
)
def test_wrong_configuration_is_named(tiny_kwargs, changes, named):
    from shotenv.env.single import ShotScheduleEnv

    with pytest.raises((ValueError, TypeError), match=named):
        ShotScheduleEnv(**{**tiny_kwargs, **changes})


def test_configuration_by_name_path_and_mapping(tiny_kwargs, tmp_path):
    path = tmp_path / "hot.yaml"
    path.write_text("name: hot\nefficiency: 0.3\n")
    by_path = make(tiny_kwargs, laser=str(path)).unwrapped.problem.config.laser
    by_map = make(tiny_kwargs, laser={"efficiency": 0.3}).unwrapped.problem.config.laser
    by_name = make(tiny_kwargs, laser="vcsel").unwrapped.problem.config.laser
    assert (by_path.name, by_path.efficiency) == ("hot", 0.3)
    assert (by_map.name, by_map.efficiency) == ("vcsel", 0.3)
    assert by_name.efficiency == 0.42


def play(env, seed, actions):
    """Observations and rewards of a single environment that is reset whenever its drive ends."""
    observations, rewards = [env.reset(seed=seed)[0]], []
    for action in actions:
        observation, reward, _, truncated, _ = env.step(action)
        rewards.append(reward)
        observations.append(env.reset()[0] if truncated else observation)
    return np.array(observations), np.array(rewards)


def test_a_vector_equals_single_environments_with_its_seeds(tiny_kwargs):
    actions = np.random.default_rng(0).integers(0, 3, (12, 3))
    vector = make_vec(tiny_kwargs, autoreset_mode="SameStep", frames_per_drive=5)
    observations, rewards = [vector.reset(seed=40)[0]], []
    for chosen in actions:
        observation, reward, *_ = vector.step(chosen)
        observations.append(observation)
        rewards.append(reward)
    for row in range(3):
        single = make(tiny_kwargs, frames_per_drive=5)
        expected, paid = play(single, 40 + row, actions[:, row])
        assert np.array_equal(np.array(observations)[:, row], expected)
        assert np.array_equal(np.array(rewards)[:, row], paid)


def sync(kwargs, mode, **changes):
    return gymnasium.make_vec(
        shotenv.ENV_ID,
        num_envs=3,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **{**kwargs, **changes},
    )


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_the_native_vector_behaves_like_gymnasiums_own(tiny_kwargs, mode):
    from gymnasium.utils.env_checker import data_equivalence

    ours = make_vec(tiny_kwargs, autoreset_mode=mode, frames_per_drive=4)
    theirs = sync(tiny_kwargs, AutoresetMode(mode), frames_per_drive=4)
    assert ours.metadata["autoreset_mode"] is AutoresetMode(mode)
    assert data_equivalence(ours.reset(seed=7), theirs.reset(seed=7))
    random, keys = np.random.default_rng(1), set()
    for _ in range(11):
        actions = random.integers(0, 3, 3)
        left, right = ours.step(actions), theirs.step(actions)
        for a, b in zip(left[:4], right[:4], strict=True):
            assert np.array_equal(a, b)
        assert set(left[4]) == set(right[4])
        for key in ("shots", "_shots", "temperature_k", "vector_reward"):
            if key in left[4]:
                assert np.array_equal(left[4][key], right[4][key]), key
        if "final_obs" in left[4]:
            for a, b in zip(left[4]["final_obs"], right[4]["final_obs"], strict=True):
                assert np.array_equal(a, b)
            assert set(left[4]["final_info"]) == set(right[4]["final_info"])
        keys |= set(left[4])
    # Both a step's infos and a new drive's were among what was compared.
    assert keys >= {"shots", "_shots", "temperature_k", "vector_reward", "drive_seed"}
    assert ("final_obs" in keys) == (mode == "SameStep")


def test_disabled_autoreset_waits_for_the_mask(tiny_kwargs):
    env = make_vec(tiny_kwargs, autoreset_mode="Disabled", frames_per_drive=3)
    env.reset(seed=0)
    for _ in range(3):
        observation, _, _, truncated, _ = env.step(np.array([0, 1, 2]))
    assert truncated.all()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.array([0, 1, 2]))
    mask = np.array([True, False, False])
    after, _ = env.reset(options={"reset_mask": mask})
    assert not np.array_equal(after[0], observation[0])
    assert np.array_equal(after[1:], observation[1:])
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.array([0, 1, 2]))
    env.reset(options={"reset_mask": ~mask})
    env.step(np.array([0, 1, 2]))
    with pytest.raises(ValueError, match="reset_mask"):
        env.reset(options={"reset_mask": [True, False, False]})


def test_wrong_vector_arguments_are_named(tiny_kwargs):
    with pytest.raises(ValueError, match="autoreset_mode"):
        make_vec(tiny_kwargs, autoreset_mode="Sometimes")
    with pytest.raises(ValueError, match="num_envs"):
        make_vec(tiny_kwargs, num_envs=0)
    with pytest.raises(ValueError, match="observation is 'film'; expected"):
        make_vec(tiny_kwargs, observation="film")
    with pytest.raises(ValueError, match="render_mode is 'human'; expected one of rgb_array"):
        make_vec(tiny_kwargs, render_mode="human")
    with pytest.raises(ValueError, match="seed has 2 values"):
        make_vec(tiny_kwargs).reset(seed=[1, 2])
