"""A person against a policy: the same drive for both, and the sums that it comes to."""

from __future__ import annotations

import numpy as np
import pytest

from agents.evaluation.match import Match
from agents.policies.fixed import FixedPolicy
from agents.report.scoreboard import NOW_PX, lines_of, match_picture
from shotenv.config.keywords import env_config
from shotenv.env.single import ShotScheduleEnv

FRAMES = 6


@pytest.fixture
def config(tiny_kwargs):
    return env_config(**{**tiny_kwargs, "frames_per_drive": FRAMES})


def test_who_plays_as_the_rival_does_ends_where_it_does(config):
    match = Match(config, FixedPolicy(4), 7)
    assert match.person == match.rival
    while not match.over:
        match.play(1)
    assert match.person == match.rival
    assert match.person.frames == FRAMES and match.person.taken == (0, 0, FRAMES, 0)


def test_both_sides_sum_up_what_the_environment_tells(config):
    match = Match(config, FixedPolicy(8), 7)
    env = ShotScheduleEnv(**config.model_dump())
    env.reset(options={"drive": 7})
    steps = [env.step(action) for action in (0, 1, 2, 0, 1, 2)]
    for action in (0, 1, 2, 0, 1, 2):
        match.play(action)
    numbers, infos = match.person.numbers, [step[4] for step in steps]
    assert numbers["return"] == pytest.approx(sum(step[1] for step in steps))
    assert numbers["laser_energy_j"] == pytest.approx(sum(i["laser_energy_j"] for i in infos))
    assert numbers["depth_mae_m"] == pytest.approx(np.mean([i["depth_mae_m"] for i in infos]))
    assert numbers["frames_taken"] == {"0": 0, "2": 2, "4": 2, "8": 2}
    assert match.rival.numbers["frames_taken"]["8"] == FRAMES
    assert match.rival.numbers["laser_energy_j"] > numbers["laser_energy_j"]


def test_the_picture_shows_the_frame_to_take_and_the_score(config):
    match = Match(config, FixedPolicy(2), 3)
    before = match_picture(match, "always_2")
    match.play(2)
    after = match_picture(match, "always_2")
    assert before.dtype == np.uint8 and before.shape == after.shape
    gray = np.sqrt(match.now())
    shown = after[: NOW_PX * 24 // 32, :NOW_PX, 0].max() / 255
    assert shown == pytest.approx(gray.max(), abs=0.01)
    assert not np.array_equal(before[:, NOW_PX + 12 :], after[:, NOW_PX + 12 :])
    first, second = lines_of("you", match.person)
    assert "score" in first and "0 / 0 / 1 frames" in second
