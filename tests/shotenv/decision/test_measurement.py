"""Measuring a batch: each drive with its own shots, the offset, and what shots cannot tell."""

from __future__ import annotations

import dataclasses

import pytest
import torch

from shotenv.config.keywords import env_config
from shotenv.decision.acquire import acquire_depth, acquire_depths, offset_to_subtract_lsb
from shotenv.decision.features import SEEN_FEATURES
from shotenv.decision.measurement import (
    _measured_by_loop,
    _measured_by_maps,
    measure_by_shots,
    measure_frames,
)
from shotenv.decision.problem import open_problem
from shotenv.decision.transition import reset, step
from unwrap.signal.shots import Shots

NAMES = [feature.name for feature in SEEN_FEATURES]


@pytest.fixture(scope="module")
def problem(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return open_problem(env_config(**tiny_kwargs))


def test_every_drive_is_measured_with_its_own_shots(problem):
    state = reset(problem, [1, 2, 3, 4])
    power_w = state.drive.laser_power_w
    shots = torch.tensor([8, 0, 2, 8])
    found = measure_by_shots(problem, state, shots, power_w, measure_frames)
    assert found.score.error[1] == 1.0 and found.score.valid_share[1] == 0.0
    for row, count in ((0, Shots.EIGHT), (2, Shots.TWO), (3, Shots.EIGHT)):
        alone = reset(problem, [row + 1])
        one = measure_frames(problem, alone.drive, alone.step, count)
        for field in dataclasses.fields(one.score):
            assert getattr(one.score, field.name)[0] == getattr(found.score, field.name)[row]
        told = [feature.least_shots <= count for feature in SEEN_FEATURES]
        assert torch.equal(found.features[row, told], one.features[0, told])


def test_what_few_shots_cannot_tell_stays_as_more_told_it(problem):
    state, _ = step(problem, reset(problem, [1, 2]), torch.tensor([2, 1]))
    first = state.seen.features
    residual, regret = NAMES.index("residual"), NAMES.index("regret_of_two")
    assert (first[:, residual] > 0).all()
    assert first[0, regret] > 0 and first[1, regret] == 0
    state, _ = step(problem, state, torch.tensor([0, 0]))
    second = state.seen.features
    assert torch.equal(second[:, [residual, regret]], first[:, [residual, regret]])
    assert not torch.equal(second[:, NAMES.index("amplitude")], first[:, NAMES.index("amplitude")])
    assert state.seen.since_four.tolist() == [1, 1]
    assert state.seen.since_eight.tolist() == [1, 1002]


def test_regret_is_the_error_term_between_prefixes_of_one_frame(problem):
    """Computed by hand from the depths of the first 2, the first 4 and all samples."""
    state = reset(problem, [1])
    scale_m = problem.config.reward.error_scale_m
    two, four, eight = acquire_depths(problem, state.drive, state.step, tuple(Shots))
    strong = eight.depth.valid
    found = measure_frames(problem, state.drive, state.step, Shots.EIGHT).features[0]
    for name, one, other in (
        ("regret_of_two", two, eight),
        ("regret_of_four", four, eight),
        ("two_from_four", two, four),
    ):
        apart_m = (one.depth.distance_m - other.depth.distance_m).abs()[strong].double()
        expected = 4 * (apart_m / (apart_m + scale_m)).mean()
        assert found[NAMES.index(name)].item() == pytest.approx(expected.item(), rel=1e-5)
    # Each depth is that of an acquisition of so many samples alone.
    for one, shots in ((two, Shots.TWO), (four, Shots.FOUR)):
        alone = acquire_depth(problem, state.drive, state.step, shots)
        assert torch.equal(one.depth.distance_m, alone.depth.distance_m)
        assert torch.equal(one.depth.valid, alone.depth.valid)


def test_the_reference_is_the_error_of_four_whatever_is_taken(problem):
    state = reset(problem, [1, 2])
    four = measure_frames(problem, state.drive, state.step, Shots.FOUR).score.error
    for shots in Shots:
        found = measure_frames(problem, state.drive, state.step, shots)
        assert torch.equal(found.error_of_four, four)
    by_shots = measure_by_shots(
        problem, state, torch.tensor([0, 2]), state.drive.laser_power_w, measure_frames
    )
    assert torch.equal(by_shots.error_of_four, four)


def test_the_stored_offset_is_needed_with_two_samples_alone(problem):
    """An offset that is stored wrong shows in the phase of 2 DCS; 4 and 8 cancel what there is."""
    state = reset(problem, [5])
    stored = state.drive.offsets.calibrated_lsb
    wrong = dataclasses.replace(
        state.drive,
        offsets=dataclasses.replace(state.drive.offsets, calibrated_lsb=stored + 30.0),
    )
    for shots in Shots:
        maps = [
            acquire_depth(problem, drive, state.step, shots).depth.phase_rad
            for drive in (state.drive, wrong)
        ]
        assert torch.equal(*maps) == (shots != Shots.TWO)
    assert offset_to_subtract_lsb(state.drive, Shots.TWO) is stored


@pytest.mark.parametrize("eight", ["two_frequency", "network"])
def test_the_loop_measures_as_the_chain_of_maps_to_the_last_bit(tiny_kwargs, eight):
    """Each number of samples, and a laser that emits less than its own power in some drives."""
    problem = open_problem(env_config(**{**tiny_kwargs, "eight": eight}))
    state = reset(problem, [1, 2, 3, 4, 5, 6])
    shots = torch.tensor([8, 0, 2, 4, 8, 2])
    less = torch.tensor([1.0, 1.0, 1.0, 0.7, 0.5, 0.6], dtype=torch.float64)
    for power_w in (state.drive.laser_power_w, less * state.drive.laser_power_w):
        asked = problem, state.drive, state.step, shots, power_w
        loop, maps = _measured_by_loop(*asked), _measured_by_maps(*asked)
        for field in dataclasses.fields(loop.score):
            assert torch.equal(getattr(loop.score, field.name), getattr(maps.score, field.name))
        assert torch.equal(loop.error_of_four, maps.error_of_four)
        for row, count in enumerate(shots.tolist()):
            told = [count >= feature.least_shots for feature in SEEN_FEATURES]
            assert torch.equal(loop.features[row, told], maps.features[row, told])
