"""Temporal error: closed forms, still scenes, and the table against frames acquired one by one."""

import dataclasses

import numpy as np
import pytest
import torch

from agents.evaluation.play import make_envs, play_drives
from agents.optimum.tabulation import drive_of
from agents.optimum.temporal_error import (
    STILL_M,
    SignedErrors,
    tabulate_temporal_errors,
    temporal_error_m,
)
from agents.policies.fixed import RandomPolicy
from shotenv.config.keywords import env_config
from shotenv.decision.acquire import acquire_depth, acquire_depths
from shotenv.decision.measurement import score_of
from shotenv.decision.problem import open_problem
from unwrap.signal import Shots

SEEDS = [1000, 1001]
NAN = float("nan")


@pytest.fixture(scope="module")
def problem(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return open_problem(env_config(**tiny_kwargs, split="test"))


def errors(error_m, truth_m, counted):
    """Of one frame with one row of pixels, the same with each number of samples."""
    each = torch.ones(len(Shots), 1, 1, 1)
    return SignedErrors(
        torch.tensor([[error_m]]) * each,
        torch.tensor([[counted]]) & each.bool(),
        torch.tensor([[truth_m]]),
    )


def test_what_stands_still_and_counts_in_both_frames_changes_by_a_known_amount():
    """Changes of .4 and .2 m count; then a mover, one not counted now, one not before, the sky."""
    inf = float("inf")
    before = errors(
        [0.1, -0.1, 0.0, 0.0, NAN, 0.0],
        [5.0, 6.0, 7.0, 8.0, 9.0, inf],
        [True, True, True, True, False, True],
    )
    now = errors(
        [-0.3, 0.1, 6.0, NAN, 3.0, 3.0],
        [5.0 + 0.9 * STILL_M, 6.0 - 0.9 * STILL_M, 7.0 + 1.1 * STILL_M, 8.0, 9.0, inf],
        [True, True, True, False, True, True],
    )
    found = temporal_error_m(before, now)
    assert found.shape == (len(Shots), len(Shots), 1)
    assert torch.allclose(found, torch.full_like(found, 0.3))


def test_rows_are_the_action_before_and_columns_the_one_now():
    before, now = (errors([0.0, 0.0], [5.0, 6.0], [True, True]) for _ in range(2))
    offsets_m = torch.tensor([0.0, 1.0, 3.0]).reshape(-1, 1, 1, 1)
    shifted = dataclasses.replace(now, error_m=now.error_m + offsets_m)
    assert temporal_error_m(before, shifted)[..., 0].tolist() == [[0.0, 1.0, 3.0]] * 3
    assert temporal_error_m(shifted, shifted)[0, :, 0].tolist() == [0.0, 1.0, 3.0]
    assert temporal_error_m(shifted, before)[:, 0, 0].tolist() == [0.0, 1.0, 3.0]


def test_where_nothing_stands_still_there_is_none():
    found = temporal_error_m(errors([0.0], [5.0], [True]), errors([0.0], [6.0], [True]))
    assert found.isnan().all()


def test_a_still_scene_without_noise_has_none_of_it_and_with_noise_some(problem):
    drive, step = drive_of(problem, SEEDS[0]), torch.zeros(1, dtype=torch.int64)
    still = dataclasses.replace(drive, frames=drive.frames[:, :1].expand_as(drive.frames))
    quiet = [torch.zeros(1, 2, problem.bank.height, problem.bank.width)] * Shots.EIGHT

    def taken(at, noise=None):
        return SignedErrors.of(acquire_depths(problem, still, at, tuple(Shots), noise=noise))

    without = temporal_error_m(taken(step, quiet), taken(step + 1, quiet))
    for action in range(len(Shots)):
        assert without[action, action].item() == 0.0
    assert without[0, 2].item() > 0.0, "2 and 8 samples err differently"
    assert (temporal_error_m(taken(step), taken(step + 1)) > 0.0).all()


def slow_error_m(before, now):
    """The same of two single acquisitions, pixel by pixel."""
    maps = [
        one.ravel().double().tolist()
        for each in (before, now)
        for one in (each.depth.distance_m, each.truth_m, each.depth.valid, each.scored)
    ]
    changes_m = [
        abs((now_m - now_truth_m) - (before_m - before_truth_m))
        for before_m, before_truth_m, good, scored, now_m, now_truth_m, *rest in zip(
            *maps, strict=True
        )
        if all((good, scored, *rest)) and abs(now_truth_m - before_truth_m) < STILL_M
    ]
    return np.mean(changes_m) if changes_m else NAN


def test_played_drives_have_what_their_frames_acquired_one_by_one_have(problem):
    envs = make_envs(problem.config, "test", len(SEEDS), "Disabled")
    played = play_drives(RandomPolicy(1), envs, SEEDS)
    shots = played.shots.copy()
    shots[:, 6::7] = 0  # as if the laser had been off
    table = tabulate_temporal_errors(problem, SEEDS)
    found = dataclasses.replace(played, shots=shots).with_temporal_errors(table)
    starts, compared = {clip.start for clip in problem.bank.clips}, 0
    for n, seed in enumerate(SEEDS):
        drive, before = drive_of(problem, seed), None
        for t in range(problem.config.frames_per_drive):
            step, now, error_m = torch.tensor([t]), None, NAN
            if shots[n, t]:
                now = acquire_depth(problem, drive, step, Shots(int(shots[n, t])))
                # The noise is that with which the drive was played.
                score = score_of(problem, now)
                assert score.depth_mae_m.item() == played.depth_mae_m[n, t]
            if before and now and int(drive.frame(step)) not in starts:
                error_m = slow_error_m(before, now)
            expected = pytest.approx(error_m, rel=1e-4, nan_ok=True)
            assert found.temporal_error_m[n, t] == expected, (seed, t)
            compared += np.isfinite(error_m)
            before = now
    assert compared > 10


def test_of_a_derated_laser_none_is_known(problem):
    laser = problem.config.laser.model_copy(update={"derate_k": 310.0, "derate_per_k": 0.02})
    config = problem.config.model_copy(update={"laser": laser})
    found = tabulate_temporal_errors(dataclasses.replace(problem, config=config), SEEDS)
    assert np.isnan(found).all()
