"""A bank of recordings: what comes in goes out again, word for word, and plays."""

from __future__ import annotations

import json
import pickle

import gymnasium
import numpy as np
import pytest
import torch
from PIL import Image

from agents.cli.entry import main
from shotenv.bank.files.layout import BankError
from shotenv.bank.files.store import verify
from shotenv.bank.opening import open_bank
from shotenv.config.keywords import env_config
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import reset, step
from unwrap.signal.shots import Shots

FRAMES = 13


def test_words_gray_truth_and_speeds_are_those_of_the_files(bank, drives):
    assert len(bank) == FRAMES * len(drives) and bank.truth_level == "external"
    for clip, one in zip(bank.clips, drives, strict=True):
        frames = torch.arange(clip.start, clip.start + clip.frames)
        for shots in Shots:
            raw, words = one.raws[shots], bank.words(frames, shots)
            assert torch.equal(words.dcs_lsb, raw.dcs_lsb)
            assert torch.equal(words.saturated, raw.saturated)
        assert torch.equal(bank.gray(frames).int(), one.gray.int())
        truth_m = bank.distance_m(frames)
        np.testing.assert_array_equal(truth_m.numpy(), one.truth_m.numpy())
        own = bank.settings(clip)
        assert own.is_like(one.settings)
        rows = slice(clip.start, clip.start + clip.frames)
        assert tuple(bank.ego_speed_m_s[rows]) == one.facts.ego_speed_m_s
        assert tuple(bank.gray_exposure_s[rows]) == one.facts.gray_exposure_s
        assert np.allclose(bank.time_s[rows], 0.1 * np.arange(FRAMES))


def test_a_replay_has_the_returns_of_the_simulation(bank, simulated, drives):
    played = env_config(
        bank=str(bank.folder),
        split="test",
        unwrapper=simulated.config.unwrapper,
        frames_per_drive=simulated.config.frames_per_drive,
    )
    replayed = open_problem(played)
    for actions in (0, 1, 2, (2, 0, 1)):
        seeds = [one.facts.seed for one in drives]
        states = [reset(problem, seeds) for problem in (simulated, replayed)]
        for frame in range(simulated.config.frames_per_drive):
            action = actions if isinstance(actions, int) else actions[frame % 3]
            chosen = torch.full((len(seeds),), action)
            outcomes = []
            for place, problem in enumerate((simulated, replayed)):
                states[place], outcome = step(problem, states[place], chosen)
                outcomes.append(outcome)
            assert torch.equal(outcomes[0].reward, outcomes[1].reward)
            assert torch.equal(outcomes[0].shots, outcomes[1].shots)


def test_its_own_configuration_plays_it(bank, tiny_unwrapper):
    env = gymnasium.make(
        "shotenv/ShotSchedule-v0", config=str(bank.folder / "env.yaml"), unwrapper=tiny_unwrapper
    )
    _, info = env.reset(seed=1, options={"drive": 5})
    assert info["drive_seed"] == 5
    assert env.spec.max_episode_steps == FRAMES - 1
    over = False
    while not over:
        *_, over, info = env.step(2)
    assert info["depth_mae_m"] >= 0
    assert env.unwrapped.action_masks().tolist() == [True] * 3


def test_workers_open_it_for_themselves(bank):
    again = pickle.loads(pickle.dumps(bank))
    assert again.fingerprint == bank.fingerprint
    one = torch.tensor([3])
    assert torch.equal(again.words(one, Shots.TWO).dcs_lsb, bank.words(one, Shots.TWO).dcs_lsb)


def test_the_commands_tell_what_it_is_and_check_it(bank, folder, tmp_path, capsys):
    told, out = tmp_path / "told.json", tmp_path / "bank"
    camera = str(folder / "camera" / "bench.yaml")
    words = ["bank", "import", str(folder), "--camera", camera, "--out", str(out)]
    assert main([*words, "--truth", "own", "--json", str(told)]) == 0
    printed = capsys.readouterr().out
    assert "answers 2, 4, 8 DCS" in printed and "their own eight samples" in printed
    assert str(out / "env.yaml") in printed
    about = json.loads(told.read_text())
    assert about["recorded"]["truth"] == "own" and about["recorded"]["camera"] == "bench"
    assert about["splits"] == {"test": {"street": 2 * FRAMES}}
    sheet = tmp_path / "sheet.png"
    assert main(["bank", "info", str(out), "--sheet", str(sheet)]) == 0
    with Image.open(sheet) as image:
        assert image.size[0] > 100
    assert "bench at 10 Hz" in capsys.readouterr().out
    assert main(["bank", "verify", str(out)]) == 0
    # The same recordings with another truth are another bank of the same words.
    assert open_bank(out).fingerprint != bank.fingerprint


def test_what_is_damaged_is_named(folder, take_in, tmp_path):
    bank = take_in(folder, tmp_path / "bank")
    words = bank.folder / bank.manifest.clips[0].folder / "words.npy"
    content = bytearray(words.read_bytes())
    content[-1] ^= 1
    words.write_bytes(content)
    assert verify(bank.folder) == (f"{bank.manifest.clips[0].folder}/words.npy",)
    words.write_bytes(content[:-2])
    with pytest.raises(BankError, match=r"words.npy holds int16 .* import the recordings again"):
        open_bank(bank.folder)
    told = bank.folder / "recorded.json"
    told.write_text(told.read_text().replace('"external"', '"none"'))
    with pytest.raises(BankError, match=r"recorded.json is damaged .* import the recordings again"):
        open_bank(bank.folder)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        (
            {"sensor": {"f2_hz": 12e6, "max_range_m": 12.0}},
            "sensor.f2_hz is 1.2e\\+07, but bank bench",
        ),
        ({"frame_rate_hz": 5.0}, "frame_rate_hz is 5, but bank bench was recorded with 10"),
    ],
)
def test_another_sensor_or_frame_rate_is_refused(bank, tiny_unwrapper, fields, message):
    with pytest.raises(ValueError, match=message):
        open_problem(
            env_config(bank=str(bank.folder), split="test", unwrapper=tiny_unwrapper, **fields)
        )
