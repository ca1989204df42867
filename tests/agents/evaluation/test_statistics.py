import numpy as np
import pytest

from agents.config.study_config import StudyConfig
from agents.evaluation.statistics import (
    Interval,
    excess,
    interval,
    ratio,
    resampled,
    resampled_each,
)

mean = np.mean


def mean_difference(a, b, axis):
    return np.mean(a - b, axis=axis)


SETTINGS = {"draws": 2000, "confidence": 0.95}


def test_interval_of_a_mean_matches_the_normal_one():
    values = np.random.default_rng(3).normal(2.0, 1.0, 400)
    found = interval(mean, values, **SETTINGS)
    half_width = 1.96 * values.std(ddof=1) / np.sqrt(values.size)
    assert found.value == pytest.approx(values.mean())
    assert found.low == pytest.approx(values.mean() - half_width, abs=0.02)
    assert found.high == pytest.approx(values.mean() + half_width, abs=0.02)


def test_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(7)
    trials = [
        interval(mean, rng.normal(0.0, 1.0, 24), draws=400, confidence=0.9) for _ in range(150)
    ]
    # BCa intervals of 24 values cover a little less than they say; 150 trials tell to 5 %.
    covered = np.mean([found.low <= 0.0 <= found.high for found in trials])
    assert 0.82 <= covered <= 0.96


def test_pairing_removes_what_the_drives_share():
    rng = np.random.default_rng(0)
    drive = rng.normal(0.0, 10.0, 30)
    better, worse = drive + 1.0 + rng.normal(0, 0.1, 30), drive
    paired = interval(mean_difference, better, worse, **SETTINGS)
    assert paired.low == pytest.approx(1.0, abs=0.1) and paired.high > paired.low
    alone = interval(mean, better, **SETTINGS)
    assert alone.low < 0.0 < alone.high


def test_a_constant_sample_has_an_interval_of_no_width():
    assert interval(mean, [3.0] * 5, **SETTINGS) == Interval(3.0, 3.0, 3.0)


def test_excess_is_the_ratio_of_sums():
    assert excess(np.array([3.0, 3.0]), np.array([2.0, 3.0])) == pytest.approx(0.2)


def test_same_seed_same_interval():
    values = np.arange(10.0)
    assert interval(mean, values, seed=4, **SETTINGS) == interval(mean, values, seed=4, **SETTINGS)
    assert interval(mean, values, seed=4, **SETTINGS) != interval(mean, values, seed=5, **SETTINGS)


def test_named_renames_the_point_estimate():
    assert Interval(1.0, 0.5, 2.0).named("mean") == {"mean": 1.0, "low": 0.5, "high": 2.0}


@pytest.mark.parametrize(
    "samples", [([1.0],), ([1.0, 2.0], [1.0]), ([1.0, np.nan],), ([[1.0, 2.0]],)]
)
def test_unusable_samples_are_refused(samples):
    with pytest.raises(ValueError, match="samples"):
        interval(mean, *samples, **SETTINGS)


def test_a_ratio_is_resampled_with_both_of_its_parts():
    total, count = np.array([8.0, 2.0, 5.0, 1.0]), np.array([16.0, 4.0, 10.0, 2.0])
    # Twice as many frames and twice the sum: the mean of every resample is the same.
    assert interval(ratio, total, count, **SETTINGS) == Interval(0.5, 0.5, 0.5)


def test_resampled_agrees_with_the_interval_of_a_plain_mean():
    values = np.random.default_rng(3).normal(2.0, 1.0, 60)
    study = StudyConfig(bootstrap_draws=2000)
    found = resampled(lambda weight: float(weight @ values / weight.sum()), 60, study)
    usual = interval(mean, values, **SETTINGS)
    assert found.value == pytest.approx(values.mean())
    assert found.low == pytest.approx(usual.low, abs=0.05)
    assert found.high == pytest.approx(usual.high, abs=0.05)


def test_statistics_of_one_call_share_their_resamples():
    values = np.random.default_rng(3).normal(2.0, 1.0, 20)

    def statistics(weight):
        mean = float(weight @ values / weight.sum())
        return {"mean": mean, "more": mean + 1.0, "difference": (mean + 1.0) - mean}

    found = resampled_each(statistics, 20, StudyConfig(bootstrap_draws=500))
    assert found["difference"] == Interval(*[pytest.approx(1.0)] * 3)
    assert found["more"].low == pytest.approx(found["mean"].low + 1.0)
    assert found["mean"].low < found["mean"].value < found["mean"].high
