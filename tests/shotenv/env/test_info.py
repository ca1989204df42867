"""Infos: the same numbers after reset and step, and whatever stacks them goes on."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers

import shotenv
from shotenv.env import INFO_KEYS
from shotenv.env.info import INFO_ENTRIES


def make(kwargs, **changes):
    return gymnasium.make(shotenv.ENV_ID, **{**kwargs, **changes})


def make_vec(kwargs, **changes):
    return gymnasium.make_vec(shotenv.ENV_ID, 3, **{**kwargs, **changes})


def kinds(info):
    """What each key of an info is: its type and shape."""
    return {
        key: kinds(value) if isinstance(value, dict) else (type(value), np.shape(value))
        for key, value in info.items()
    }


def test_reset_and_step_tell_the_same_kinds_of_numbers(tiny_kwargs):
    env = make(tiny_kwargs)
    _, first = env.reset(seed=0)
    *_, second = env.step(1)
    assert tuple(first) == tuple(second) == INFO_KEYS
    assert kinds(first) == kinds(second)
    plain = {type(v) for v in first.values()} - {dict, np.ndarray}
    assert plain == {bool, int, float}


def test_before_the_first_frame_nothing_has_been_spent(tiny_kwargs):
    env = make(tiny_kwargs)
    _, start = env.reset(seed=0)
    unplayed = [entry.name for entry in INFO_ENTRIES if entry.at_start is not None]
    assert "energy_j" in unplayed and all(start[name] == 0 for name in unplayed)
    assert not np.any(start["vector_reward"]) and not any(start["reward_terms"].values())
    *_, after = env.step(2)
    for name in ("drive_seed", "laser_power_w", "integration_s", "ambient_k"):
        assert start[name] == after[name]
    assert (
        0.0
        < after["energy_j"]
        == pytest.approx(
            sum(
                after[f"{part}_energy_j"]
                for part in ("laser", "driver", "readout", "static", "network")
            )
        )
    )


def test_the_family_is_a_code_with_a_name(tiny_kwargs):
    env, envs = make(tiny_kwargs), make_vec(tiny_kwargs)
    bank = env.unwrapped.problem.bank
    assert env.unwrapped.family_names == envs.unwrapped.family_names
    _, info = env.reset(seed=0)
    drive = env.unwrapped.state.drive
    for step in range(12):
        # At reset the family of the first frame, afterwards that of the frame played.
        clip = bank.clip_of(int(drive.frames[0, max(step - 1, 0)]))
        assert env.unwrapped.family_names[info["family"]] == clip.family
        *_, info = env.step(0)
    _, infos = envs.reset(seed=0)
    assert infos["family"].dtype == np.int64


def test_the_next_step_tells_of_drives_that_went_on_and_of_new_ones(tiny_kwargs):
    envs = make_vec(tiny_kwargs, autoreset_mode="Disabled", frames_per_drive=2)
    envs.reset(seed=0)
    envs.step(np.array([1, 1, 1]))
    envs.step(np.array([1, 1, 1]))
    _, infos = envs.reset(options={"reset_mask": np.array([True, False, False])})
    assert infos["_shots"].tolist() == infos["_reward_terms"].tolist() == [True, False, False]
    assert infos["reward_terms"]["_error"].tolist() == [True, False, False]


@pytest.mark.parametrize("frames", [3, 32])
def test_single_wrappers_work(tiny_kwargs, frames):
    env = wrappers.TimeAwareObservation(make(tiny_kwargs, frames_per_drive=frames))
    env = wrappers.RecordEpisodeStatistics(wrappers.NormalizeObservation(env))
    env = wrappers.NumpyToTorch(env)
    _, info = env.reset(seed=0)
    assert isinstance(info["vector_reward"], torch.Tensor)
    for step in range(1, frames + 1):
        observation, _, _, over, info = env.step(1)
        assert over == (step == frames)
    assert observation.shape == (len(env.unwrapped.feature_names) + 1,)
    assert info["episode"]["l"] == frames


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_vector_wrappers_work(tiny_kwargs, mode):
    envs = make_vec(tiny_kwargs, frames_per_drive=2, autoreset_mode=mode)
    envs = vector_wrappers.RecordEpisodeStatistics(envs)
    # Gymnasium's last observations in SameStep are an array of objects, which torch does not know.
    if mode == "NextStep":
        envs = vector_wrappers.NumpyToTorch(envs)
    _, infos = envs.reset(seed=0)
    assert torch.as_tensor(infos["family"]).dtype == torch.int64
    lengths = []
    for _ in range(5):
        *_, infos = envs.step(torch.tensor([0, 1, 2]))
        if "episode" in infos:
            lengths += infos["episode"]["l"].tolist()
    # Gymnasium 1.2 counts episodes after the first of SameStep one step short.
    assert lengths[:3] == [2] * 3 and len(lengths) == 6


def test_infos_become_a_list(tiny_kwargs):
    envs = vector_wrappers.DictInfoToList(make_vec(tiny_kwargs, frames_per_drive=2))
    _, infos = envs.reset(seed=0)
    assert [tuple(info) for info in infos] == [INFO_KEYS] * 3
    for _ in range(4):
        *_, infos = envs.step(np.array([0, 1, 2]))
        assert [tuple(info) for info in infos] == [INFO_KEYS] * 3
