"""Drives go to Minari and back without loss."""

from __future__ import annotations

import gymnasium
import minari
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import shotenv
from agents.cli.entry import main
from agents.evaluation.episodes import play_episodes, stacked, write_dataset
from agents.policies.fixed import RandomPolicy


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "minari"))


@pytest.mark.parametrize("env_id", [shotenv.ENV_ID, shotenv.IMAGE_ENV_ID, shotenv.MO_ENV_ID])
def test_episodes_come_back_as_they_were(tiny_kwargs, env_id):
    kwargs = {**tiny_kwargs, "frames_per_drive": 5, "outcomes": True}
    env = gymnasium.make(env_id, **kwargs)
    played = play_episodes(RandomPolicy(), env, [3, 4])
    write_dataset("shotenv/tiny-v0", env, played, policy="random", description="a test")
    dataset = minari.load_dataset("shotenv/tiny-v0")
    assert dataset.total_episodes == 2 and dataset.total_steps == 10
    for one, back in zip(played, dataset, strict=True):
        assert data_equivalence(one.observations, back.observations)
        assert np.array_equal(one.actions, back.actions)
        assert np.array_equal(np.array(one.rewards), back.rewards)
        assert np.array_equal(one.truncations, back.truncations)
        assert equal(one.infos, back.infos)
    # And the environment: the same actions bring the same numbers.
    again = dataset.recover_environment()
    told = [again.reset(seed=3)]
    told += [again.step(int(action)) for action in dataset[0].actions]
    assert data_equivalence(stacked([step[0] for step in told]), dataset[0].observations)
    assert again.spec.max_episode_steps == 5


def equal(left, right) -> bool:
    """Infos, whatever the order of their keys."""
    if isinstance(left, dict):
        return set(left) == set(right) and all(equal(left[key], right[key]) for key in left)
    return left.dtype == right.dtype and np.array_equal(left, right)


def test_the_command_writes_what_it_played(tiny_kwargs, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("agents.cli.collect_command.prepare_bank", lambda config: None)
    words = ["--env.bank", tiny_kwargs["bank"], "--env.unwrapper", tiny_kwargs["unwrapper"]]
    words += ["--env.frames_per_drive", "4", "--episodes", "2", "--outcomes", "true"]
    assert main(["collect", "shotenv/mine-v0", "--policy", "always_4", *words]) == 0
    assert "8 frames are in" in capsys.readouterr().out
    dataset = minari.load_dataset("shotenv/mine-v0")
    assert dataset.total_steps == 8
    assert dataset[0].infos["shots"].tolist() == [0, 4, 4, 4, 4]
    assert dataset[0].infos["outcomes"]["shots"][1:].tolist() == [[2, 4, 8]] * 4
    assert main(["collect", "shotenv/mine-v0", "--policy", "always_4", *words]) == 1
    assert "already exists" in capsys.readouterr().err


def test_a_policy_that_there_is_not_is_named(capsys):
    assert main(["collect", "shotenv/mine-v0", "--policy", "cleverest"]) == 2
    assert "policy is 'cleverest'; expected random, always_2" in capsys.readouterr().err
