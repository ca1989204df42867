"""Recorded samples played as drives: what was simulated and recorded is played again to the bit."""

from __future__ import annotations

import dataclasses

import pytest
import torch
from word_banks import HeldWords, replayed_problem

from shotenv.bank.files.layout import BankError
from shotenv.decision.acquire import acquire_depths
from shotenv.decision.drive import DriveOptions
from shotenv.decision.measurement_cache import MeasurementCache
from shotenv.decision.problem import problem_of
from shotenv.decision.state import observe
from shotenv.decision.transition import allowed_actions, drive_of_seed, reset, step
from unwrap.signal.shots import Shots

SEEDS = (5, 6, 2**61 + 7)


def fields_equal(one, other):
    for field in dataclasses.fields(one):
        assert torch.equal(getattr(one, field.name), getattr(other, field.name)), field.name


@pytest.mark.parametrize("actions", [(0,), (1,), (2,), (2, 0, 1, 0)])
def test_a_replay_brings_what_the_simulation_brought(simulated, replayed, actions):
    before, after = (reset(problem, SEEDS) for problem in (simulated, replayed))
    # As the drives were recorded: at the power of a laser that heat never holds back.
    for frame in range(simulated.config.frames_per_drive):
        chosen = torch.full((len(SEEDS),), actions[frame % len(actions)])
        assert torch.equal(observe(simulated, before), observe(replayed, after))
        before, one = step(simulated, before, chosen)
        after, other = step(replayed, after, chosen)
        assert not one.tripped.any()
        assert torch.equal(one.reward, other.reward)
        assert torch.equal(one.shots, other.shots)
        fields_equal(one.score, other.score)
        fields_equal(one.cost, other.cost)
    assert one.truncated.all() and other.truncated.all()


def test_words_and_depth_are_those_of_the_simulation(simulated, replayed):
    at = torch.tensor([3])
    pairs = zip(
        *(
            acquire_depths(problem, drive_of_seed(problem, 6), at, tuple(Shots))
            for problem in (simulated, replayed)
        ),
        strict=True,
    )
    for one, other in pairs:
        assert torch.equal(one.raw.dcs_lsb, other.raw.dcs_lsb)
        assert torch.equal(one.raw.saturated, other.raw.saturated)
        assert torch.equal(one.depth.distance_m, other.depth.distance_m)
        assert torch.equal(one.scored, other.scored)


def test_a_cache_gives_the_same(replayed):
    state = reset(replayed, SEEDS)
    cache, chosen = MeasurementCache(), torch.tensor([0, 1, 2])
    for measure in (cache, cache):
        _, found = step(replayed, state, chosen, measure=measure)
        _, plain = step(replayed, state, chosen)
        assert torch.equal(found.reward, plain.reward)


def test_what_was_not_recorded_is_masked_and_refused(simulated, drives):
    problem = replayed_problem(simulated, drives, answers=(Shots.TWO, Shots.FOUR))
    state = reset(problem, SEEDS)
    assert allowed_actions(problem, state).tolist() == [[True, True, False]] * 3
    step(problem, state, torch.tensor([0, 1, 1]))
    with pytest.raises(
        ValueError, match=r"action is 2 \(8 DCS\), but bank held only answers 0 \(2 .* and 1 \(4"
    ):
        step(problem, state, torch.tensor([0, 1, 2]))


def test_the_most_samples_are_asked_for_first(simulated, drives):
    problem = replayed_problem(simulated, drives)
    state = reset(problem, SEEDS)
    step(problem, state, torch.tensor([2, 2, 2]))
    assert problem.bank.asked == [Shots.EIGHT, Shots.FOUR, Shots.TWO]


def shortened(recorded, frames, name):
    facts = recorded.facts.model_dump()
    for field in ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s"):
        facts[field] = facts[field][:frames]
    return dataclasses.replace(
        recorded,
        raws={
            n: type(r)(r.dcs_lsb[:frames], r.saturated[:frames]) for n, r in recorded.raws.items()
        },
        gray=recorded.gray[:frames],
        truth_m=recorded.truth_m[:frames],
        facts=type(recorded.facts)(**{**facts, "frames": frames, "name": name}),
    )


def test_only_clips_that_were_recorded_alike_are_strung_together(simulated, drives):
    parts = [
        shortened(drives[0], 12, "a"),
        shortened(drives[1], 9, "b"),
        shortened(drives[0], 7, "c"),
    ]
    problem = replayed_problem(simulated, parts)
    for seed in range(20):
        drive = drive_of_seed(problem, seed)
        places = {problem.bank.clip_of(frame).name for frame in drive.frames[0].tolist()}
        if seed == SEEDS[1]:
            assert places == {"b"}
        assert places in ({"a", "c"}, {"b"})
        own = problem.bank.settings(problem.bank.clip_of(int(drive.frames[0, 0])))
        assert float(drive.laser_power_w) == own.laser_power_w
        assert float(drive.ambient_k) == own.ambient_k


def test_a_clip_longer_than_a_drive_is_not_left(simulated, drives):
    config = simulated.config.model_copy(update={"frames_per_drive": 10})
    bank = HeldWords(drives[:1], key="one")
    problem = problem_of(bank, config)
    starts = set()
    for seed in range(30):
        frames = drive_of_seed(problem, seed).frames[0]
        assert torch.equal(frames, frames[0] + torch.arange(11))
        starts.add(int(frames[0]))
    assert min(starts) < 4 and max(starts) > len(bank) - 16


def test_what_was_recorded_cannot_be_set(replayed):
    with pytest.raises(ValueError, match=r"laser_power_w is 3.0; expected none, .* recorded one"):
        reset(replayed, [1], DriveOptions(laser_power_w=3.0))
    # The price is no part of a recording.
    state = reset(replayed, [1], DriveOptions(power_price=0.07))
    assert float(state.drive.power_price) == 0.07


def test_no_light_is_made_up(replayed):
    with pytest.raises(BankError, match="bank held holds samples that a camera took, and no light"):
        replayed.bank.exposure(torch.tensor([0]))


def test_settings_that_the_configuration_cannot_have_are_refused(simulated, drives):
    warm = dataclasses.replace(drives[0].settings, ambient_k=400.0)
    with pytest.raises(BankError, match=r"ambient_k of clip drive_5 in bank held is 400; expected"):
        replayed_problem(simulated, [dataclasses.replace(drives[0], settings=warm)])
