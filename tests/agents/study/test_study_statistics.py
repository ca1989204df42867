"""Interquartile means, intervals over seeds and clips, probabilities of improvement."""

import numpy as np
import pytest

from agents.config.study_config import StudyConfig
from agents.study.seed_statistics import Resamples, interquartile_mean
from agents.study.table_fronts import leaves_out

STUDY = StudyConfig(bootstrap_draws=400)
CLIPS = 12
SCORES = np.random.default_rng(3).normal(size=(5, CLIPS))


@pytest.fixture
def resamples() -> Resamples:
    return Resamples.draw(CLIPS, STUDY)


def test_interquartile_mean_leaves_out_a_quarter_at_either_end():
    eight = np.array([100.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -50.0])
    assert interquartile_mean(eight) == pytest.approx((2 + 3 + 4 + 5) / 4)
    assert interquartile_mean(np.array([2.0, 4.0, 9.0])) == pytest.approx(5.0), "of few all count"
    both = interquartile_mean(np.stack([eight, -eight]), axis=1)
    np.testing.assert_allclose(both, [3.5, -3.5])


def test_policies_that_are_identical_improve_as_often_as_not(resamples):
    same = resamples.improvement(SCORES, SCORES, (0, 1))
    assert same.value == pytest.approx(0.5)
    assert same.low < 0.5 < same.high and not leaves_out(same, 0.5)
    rule = resamples.improvement(SCORES[:1], SCORES[:1], (0, 1))
    assert (rule.low, rule.high) == pytest.approx((0.5, 0.5)), "ties count half"
    assert not leaves_out(rule, 0.5)


def test_a_policy_that_is_better_everywhere_improves_for_certain(resamples):
    more = SCORES + 10.0
    assert vars(resamples.improvement(more, SCORES, (0, 1))) == pytest.approx(
        {"value": 1.0, "low": 1.0, "high": 1.0}
    )
    less = resamples.improvement(SCORES, more, (0, 1))
    assert less.value == 0.0 and leaves_out(less, 0.5)


def test_improvement_is_counted_over_clips_and_pairs_of_seeds(resamples):
    one, other = np.zeros((2, CLIPS)), np.zeros((4, CLIPS))
    one[0, :3] = 1.0  # one of two seeds is better on three of twelve clips
    assert resamples.improvement(one, other, (0, 1)).value == pytest.approx(
        0.5 + 0.5 * 0.5 * 3 / 12
    )


def test_an_interval_tells_of_seeds_where_clips_are_alike(resamples):
    seeds = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    drawn = np.tile(seeds, (len(resamples.clips), 1))
    found = resamples.over_seeds(seeds, drawn, 0)
    assert found.value == 3.0 and 1.0 <= found.low < 2.5 and 3.5 < found.high <= 5.0
    alike = resamples.over_seeds(np.full(5, 2.0), np.full_like(drawn, 2.0), 0)
    assert (alike.value, alike.low, alike.high) == (2.0, 2.0, 2.0)


def test_an_interval_tells_of_clips_where_seeds_are_alike(resamples):
    """As wide as the normal approximation of the mean of the clips says."""
    clips = np.random.default_rng(0).normal(size=CLIPS)
    means = resamples.clips @ clips / CLIPS
    found = resamples.over_seeds(np.full(5, clips.mean()), np.tile(means[:, None], 5), 0)
    expected = 2 * 1.96 * clips.std() / np.sqrt(CLIPS)
    assert found.high - found.low == pytest.approx(expected, rel=0.2)
    assert found.low < clips.mean() < found.high
