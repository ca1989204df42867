"""Scores of every way of unwrapping, on scenes whose errors are known."""

import math

import pytest
import torch
from raw_frames import RANGE_M, SENSOR, raw_frame

from unwrap.depth.merge import RULES
from unwrap.depth.scoring import evaluate, mean_scores
from unwrap.signal.shots import Shots


@pytest.fixture
def scores():
    truth = torch.linspace(0.5, 24.5, 2 * 20 * 30, dtype=torch.float64).reshape(2, 20, 30)
    raws = {shots: raw_frame(truth, int(shots)) for shots in Shots}
    predicted = (truth + 2.0).float()
    truth = truth.float()
    everywhere = truth % RANGE_M < SENSOR.saturation_range_m
    return truth, evaluate(raws, predicted, truth, everywhere, SENSOR)


def test_every_method_is_scored(scores):
    assert set(scores[1]) == {
        "prediction",
        *(f"{n} DCS {rule}" for n in (2, 4) for rule in ("wrap 0", *RULES) if rule != "none"),
        "8 DCS",
    }


def test_wrap_0_is_right_only_in_the_first_half_wrap_around_it(scores):
    truth, values = scores
    share = float((truth < RANGE_M).double().mean())
    assert values["4 DCS wrap 0"]["wrap_accuracy"] == pytest.approx(share, abs=0.01)


def test_nearest_bears_a_prediction_2_m_off_where_floor_does_not(scores):
    values = scores[1]
    assert values["prediction"]["mae_m"] == pytest.approx(2.0, abs=1e-4)
    assert values["4 DCS nearest"]["wrap_accuracy"] == 1
    assert values["2 DCS nearest"]["mae_m"] < 1e-3
    assert values["4 DCS floor"]["wrap_accuracy"] == pytest.approx(1 - 2 / RANGE_M, abs=0.05)
    assert values["8 DCS"]["wrap_accuracy"] == values["8 DCS"]["valid_share"] == 1


def test_each_acquisition_may_have_its_own_prediction():
    truth = torch.linspace(0.5, 5.5, 600, dtype=torch.float64).reshape(1, 20, 30)
    raws = {shots: raw_frame(truth, int(shots)) for shots in Shots}
    truth = truth.float()
    wrong = {Shots.TWO: truth + RANGE_M, Shots.FOUR: truth + 1.0, Shots.EIGHT: truth + 9.0}
    values = evaluate(raws, wrong, truth, truth > 0, SENSOR)
    assert "prediction" not in values
    errors = [values[f"{shots:d} DCS prediction"]["mae_m"] for shots in Shots]
    assert errors == pytest.approx([RANGE_M, 1.0, 9.0], abs=1e-4)
    accuracies = [values[f"{n} DCS nearest"]["wrap_accuracy"] for n in (2, 4)]
    assert accuracies == [0.0, 1.0] and values["8 DCS"]["wrap_accuracy"] == 1.0


def test_nothing_scored_gives_nan():
    truth = torch.ones(1, 4, 4)
    raws = {Shots.FOUR: raw_frame(truth, 4)}
    values = evaluate(raws, truth, truth, truth < 0, SENSOR)
    assert math.isnan(values["4 DCS nearest"]["wrap_accuracy"])


def test_means_weigh_batches_by_their_frames_and_skip_nan():
    batches = [(1, {"a": {"x": 1.0, "y": math.nan}}), (3, {"a": {"x": 5.0, "y": 2.0}})]
    assert mean_scores(batches) == {"a": {"x": 4.0, "y": 2.0}}
