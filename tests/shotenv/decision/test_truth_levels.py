"""What recorded samples are scored against: a reference, their own eight samples, or nothing."""

from __future__ import annotations

import dataclasses
import math
import statistics

import pytest
import torch
from word_banks import replayed_problem

from shotenv.decision.acquire import acquire_depth
from shotenv.decision.outcomes import outcomes_of_all_actions
from shotenv.decision.transition import drive_of_seed, reset, step
from unwrap.depth.correction import correct
from unwrap.signal.shots import Shots

SEED, AT = 6, torch.tensor([3])
MEASURES = ("depth_mae_m", "depth_rmse_m", "wrap_accuracy", "valid_share", "within_0p1m")


@pytest.fixture(scope="module")
def own(simulated, drives):
    return replayed_problem(simulated, drives, truth_level="own")


@pytest.fixture(scope="module")
def none(simulated, drives):
    return replayed_problem(simulated, drives, truth_level="none")


def outcomes(problem, actions, frames=6):
    state, found = reset(problem, [SEED]), []
    for _ in range(frames):
        state, outcome = step(problem, state, torch.tensor(actions))
        found.append(outcome)
    return found


def test_own_truth_is_the_depth_of_eight_where_its_frequencies_agree(own):
    drive = drive_of_seed(own, SEED)
    eight = acquire_depth(own, drive, AT, Shots.EIGHT)
    alone = correct(
        eight.raw, None, own.description, noise_lsb=eight.noise_lsb, shift_m=drive.drift_m
    )
    assert torch.equal(eight.truth_m.isnan(), ~alone.valid)
    assert torch.equal(eight.truth_m[alone.valid], alone.distance_m[alone.valid])
    assert 0.1 < alone.valid.float().mean() < 1.0
    # Whatever is taken, it is scored against the same.
    two = acquire_depth(own, drive, AT, Shots.TWO)
    assert torch.equal(two.scored, eight.scored) and bool(two.scored.any())
    assert not bool((two.scored & eight.truth_m.isnan()).any())


def test_the_expected_error_of_eight_is_that_of_many_noises(own):
    """Against the spread of depth over noise that is drawn anew."""
    drive = drive_of_seed(own, SEED)
    sensor, known = own.description, {"shift_m": drive.drift_m}
    generator, ratios = torch.Generator().manual_seed(1), []
    for frame in range(12):
        eight = acquire_depth(own, drive, torch.tensor([frame]), Shots.EIGHT)
        errors_m = []
        for _ in range(200):
            normal = torch.randn(eight.raw.dcs_lsb.shape, generator=generator)
            samples = eight.raw.dcs_lsb + eight.noise_lsb.unsqueeze(1) * normal
            raw = dataclasses.replace(eight.raw, dcs_lsb=samples)
            depth = correct(raw, None, sensor, noise_lsb=eight.noise_lsb, **known)
            errors_m.append((depth.distance_m - eight.truth_m).abs())
        # Strong pixels: near the limits of what is valid noise cuts off its own tail.
        strong = eight.scored & (eight.depth.amplitude > 10 * eight.noise_lsb)
        ratio = torch.stack(errors_m).nanmean(dim=0) / eight.truth_error_m
        ratios += ratio[strong].tolist()
    assert len(ratios) > 30
    assert statistics.mean(ratios) == pytest.approx(1.0, abs=0.04)


def test_eight_are_not_scored_against_themselves(own):
    scale_m = own.config.reward.error_scale_m
    drive = drive_of_seed(own, SEED)
    for number, outcome in enumerate(outcomes(own, [2])):
        assert all(math.isnan(float(getattr(outcome.score, name))) for name in MEASURES)
        taken = acquire_depth(own, drive, torch.tensor([number]), Shots.EIGHT)
        known_m = taken.truth_error_m[taken.scored].double()
        expected = float((known_m / (known_m + scale_m)).mean())
        assert float(outcome.terms["error"]) == pytest.approx(expected, rel=1e-5)
        assert 0.0 < expected < 0.5


def test_fewer_are_scored_against_eight_and_never_better_than_these(own):
    scale_m = own.config.reward.error_scale_m
    eight = outcomes(own, [2])
    for action, shots in ((0, Shots.TWO), (1, Shots.FOUR)):
        for number, outcome in enumerate(outcomes(own, [action])):
            taken = acquire_depth(own, drive_of_seed(own, SEED), torch.tensor([number]), shots)
            apart_m = (taken.depth.distance_m - taken.truth_m).abs()[taken.scored].double()
            good = taken.depth.valid[taken.scored]
            assert float(outcome.score.depth_mae_m) == pytest.approx(
                float(apart_m[good].mean()), rel=1e-5
            )
            error_m = apart_m + taken.truth_error_m[taken.scored]
            expected = float((error_m / (error_m + scale_m)).mean())
            assert float(outcome.terms["error"]) == pytest.approx(expected, rel=1e-5)
            assert float(outcome.terms["error"]) > float(eight[number].terms["error"])


def test_own_truth_needs_no_reference(own, simulated, drives):
    blank = [dataclasses.replace(d, truth_m=torch.full_like(d.truth_m, torch.nan)) for d in drives]
    other = replayed_problem(simulated, blank, truth_level="own")
    for one, same in zip(outcomes(own, [1]), outcomes(other, [1]), strict=True):
        assert torch.equal(one.reward, same.reward)


@pytest.mark.parametrize("action", [0, 1, 2])
def test_without_truth_only_energy_and_duty_count(none, action):
    config = none.config.reward
    for outcome in outcomes(none, [action]):
        assert float(outcome.terms["error"]) == 0.0
        assert all(math.isnan(float(getattr(outcome.score, name))) for name in MEASURES)
        drive = drive_of_seed(none, SEED)
        duty = drive.always_four.duty / drive.always_eight.duty - outcome.terms["duty"]
        power = drive.always_four.energy_j / drive.always_eight.energy_j - outcome.terms["power"]
        expected = config.scale * (duty * config.duty + power * drive.power_price)
        assert float(outcome.reward) == pytest.approx(float(expected), abs=1e-12)


def test_without_truth_no_more_samples_are_asked_for_than_taken(none):
    none.bank.asked.clear()
    outcomes(none, [0], frames=1)
    assert set(none.bank.asked) == {Shots.TWO}


def test_every_level_has_all_outcomes(replayed, own, none):
    for problem in (replayed, own, none):
        table = outcomes_of_all_actions(problem, drive_of_seed(problem, SEED))
        assert table.reward.isfinite().all()
        state = reset(problem, [SEED])
        for action in range(3):
            _, outcome = step(problem, state, torch.tensor([action]))
            # The table is that of a laser at 25 C, which does not change what is measured.
            assert float(table.terms["error"][0, action]) == float(outcome.terms["error"])
