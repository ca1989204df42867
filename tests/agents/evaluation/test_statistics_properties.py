"""Intervals, for whatever samples: they scale and move with them, and lie within their range."""

from __future__ import annotations

import numpy as np
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from agents.config.study_config import StudyConfig
from agents.evaluation.statistics import Interval, interval, ratio, resampled_each
from agents.study.seed_statistics import Resamples, interquartile_mean

DRAWS = 200
numbers = st.integers(-1000, 1000).map(lambda whole: whole / 8)
clips = st.integers(2, 12)


def samples(count: int) -> st.SearchStrategy[np.ndarray]:
    return arrays(np.float64, count, elements=numbers)


@st.composite
def one_sample(draw) -> np.ndarray:
    return draw(samples(draw(clips)))


@st.composite
def two_samples(draw) -> tuple[np.ndarray, np.ndarray]:
    count = draw(clips)
    return draw(samples(count)), draw(samples(count))


def bootstrap(values: np.ndarray, confidence: float = 0.95, statistic=np.mean) -> Interval:
    return interval(statistic, values, draws=DRAWS, confidence=confidence)


def percentile(values: np.ndarray, confidence: float = 0.95) -> Interval:
    """The mean, as `resampled_each` has it."""

    def mean(weight: np.ndarray) -> dict[str, float]:
        assert weight.sum() == len(values) and weight.min() >= 0
        return {"mean": float(weight @ values / weight.sum())}

    study = StudyConfig(bootstrap_draws=DRAWS, confidence=confidence)
    return resampled_each(mean, len(values), study)["mean"]


BOTH = st.sampled_from([bootstrap, percentile])


def close(found: Interval, expected: Interval, scale: float = 1e3) -> None:
    np.testing.assert_allclose(
        (found.value, found.low, found.high),
        (expected.value, expected.low, expected.high),
        rtol=1e-9,
        atol=1e-9 * scale,
    )


@given(BOTH, one_sample(), st.integers(-20, 20))
def test_an_interval_scales_with_its_sample(of, values, power):
    scale = 2.0**power
    plain, scaled = of(values), of(scale * values)
    close(scaled, Interval(*(scale * x for x in (plain.value, plain.low, plain.high))), scale)


@given(BOTH, one_sample(), st.integers(-1000, 1000))
def test_an_interval_moves_with_its_sample(of, values, shift):
    plain = of(values)
    close(of(values + shift), Interval(*(shift + x for x in (plain.value, plain.low, plain.high))))


@given(BOTH, one_sample())
def test_a_mirrored_sample_has_the_mirrored_interval(of, values):
    plain = of(values)
    close(of(-values), Interval(-plain.value, -plain.high, -plain.low))


@given(BOTH, one_sample(), st.randoms(use_true_random=False))
def test_the_order_of_clips_decides_nothing_but_which_are_drawn(of, values, random):
    order = list(range(len(values)))
    random.shuffle(order)
    plain, shuffled = of(values), of(values[order])
    np.testing.assert_allclose(plain.value, shuffled.value, rtol=1e-12, atol=1e-12)
    # Ends are quantiles of other draws: they scatter, within what the sample spans.
    span = float(np.ptp(values))
    assert abs(plain.low - shuffled.low) <= 0.5 * span
    assert abs(plain.high - shuffled.high) <= 0.5 * span


@given(BOTH, one_sample())
def test_an_interval_lies_within_its_sample(of, values):
    found = of(values)
    rounding = 1e-9 * (1 + np.abs(values).max())
    assert values.min() - rounding <= found.low <= found.high <= values.max() + rounding
    assert values.min() - rounding <= found.value <= values.max() + rounding


@given(BOTH, one_sample(), st.floats(0.51, 0.99), st.floats(0.51, 0.99))
def test_more_confidence_is_a_wider_interval(of, values, one, other):
    narrow, wide = (of(values, confidence) for confidence in sorted((one, other)))
    rounding = 1e-9 * (1 + np.abs(values).max())
    assert wide.low <= narrow.low + rounding and narrow.high <= wide.high + rounding


@given(BOTH, numbers, clips)
def test_equal_values_leave_no_width(of, value, count):
    close(of(np.full(count, value)), Interval(value, value, value))


@given(two_samples())
def test_a_ratio_lies_within_those_of_the_clips(both):
    total, count = both[0], 1 + np.abs(both[1])
    found = interval(ratio, total, count, draws=DRAWS, confidence=0.95)
    each = total / count
    assert each.min() - 1e-9 <= found.low <= found.high <= each.max() + 1e-9


@given(two_samples())
def test_what_is_told_of_one_statistic_does_not_hang_on_the_others(both):
    study = StudyConfig(bootstrap_draws=DRAWS)
    statistics = {
        name: (lambda weight, values=values: float(weight @ values / weight.sum()))
        for name, values in zip("ab", both, strict=True)
    }

    def of(names: str) -> dict[str, Interval]:
        return resampled_each(
            lambda weight: {name: statistics[name](weight) for name in names}, len(both[0]), study
        )

    together = of("ab")
    assert together == of("ba") and together["b"] == of("b")["b"]


@given(one_sample(), st.randoms(use_true_random=False))
def test_the_interquartile_mean_is_one_of_ordered_values(values, random):
    found = float(interquartile_mean(values))
    shuffled = values.copy()
    random.shuffle(shuffled)
    assert found == float(interquartile_mean(shuffled))
    assert values.min() <= found <= values.max()
    np.testing.assert_allclose(interquartile_mean(2 * values - 3), 2 * found - 3, atol=1e-9)
    if len(values) >= 4:
        outlier = values.copy()
        outlier[np.argmax(values)] = 1e12
        assert found == float(interquartile_mean(outlier))


@given(two_samples())
def test_more_of_any_seed_is_never_a_lower_interquartile_mean(both):
    values, more = both
    assert interquartile_mean(values + np.abs(more)) >= interquartile_mean(values) - 1e-9


@st.composite
def scores(draw) -> tuple[np.ndarray, np.ndarray, int]:
    """Scores of the seeds of two policies on the same clips."""
    count = draw(clips)
    few = arrays(
        np.float64, (draw(st.integers(1, 4)), count), elements=st.integers(-3, 3).map(float)
    )
    return draw(few), draw(few), count


@given(scores())
def test_one_is_better_as_often_as_the_other_is_not(case):
    one, other, count = case
    resamples = Resamples.draw(count, StudyConfig(bootstrap_draws=DRAWS))
    there = resamples.improvement(one, other, (0, 1))
    back = resamples.improvement(other, one, (1, 0))
    close(back, Interval(1 - there.value, 1 - there.high, 1 - there.low))
    assert -1e-9 <= there.low <= there.high <= 1 + 1e-9
    assert abs(resamples.improvement(one, one, (0, 1)).value - 0.5) < 1e-9
    close(resamples.improvement(one + 10, other, (0, 1)), Interval(1.0, 1.0, 1.0))
