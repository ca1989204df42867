"""Merging, for whatever predictions: whole wraps, the nearest of all, loops as array operations."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from unwrap.depth import correction
from unwrap.depth.correction import correct
from unwrap.depth.merge import RULES, merge_nearest, merge_regression, merge_segmentation
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.frequencies import unambiguous_range_m

PIXELS = (3, 4)
METRES = 1e-4
"""Float32 is exact to 8e-6 m near 100 m."""
FARTHEST_M = 100.0

ranges_m = st.floats(1.25, 15.0)
predictions = arrays(np.float32, PIXELS, elements=st.floats(0, FARTHEST_M, width=32))
turns = arrays(np.float32, PIXELS, elements=st.floats(0, 1 - 2**-20, width=32))


@st.composite
def merges(draw):
    """Prediction, wrapped distance, unambiguous range, and the distance of saturation."""
    range_m = draw(ranges_m)
    wrapped = torch.from_numpy(draw(turns)) * range_m
    saturation_m = range_m * draw(st.floats(0.5, 1.1))
    return torch.from_numpy(draw(predictions)), wrapped, range_m, saturation_m


@pytest.mark.parametrize("merge", [merge_nearest, merge_regression])
@given(merges())
def test_a_trusted_distance_is_the_wrapped_one_and_whole_wraps(merge, case):
    predicted, wrapped, range_m, saturation_m = case
    merged = merge(predicted, wrapped, range_m, saturation_m)
    trusted = wrapped < saturation_m
    wraps = (merged.double() - wrapped)[trusted] / range_m
    assert bool((wraps > -METRES).all())
    assert float((wraps - wraps.round()).abs().max() if trusted.any() else 0) * range_m < METRES
    assert torch.equal(merged[~trusted], predicted[~trusted])


@given(merges())
def test_no_candidate_is_nearer_than_the_nearest(case):
    predicted, wrapped, range_m, _ = case
    merged = merge_nearest(predicted, wrapped, range_m, range_m + 1)
    for n in range(int(FARTHEST_M / range_m) + 2):
        other = (wrapped.double() + n * range_m - predicted).abs()
        assert bool(((merged.double() - predicted).abs() <= other + METRES).all())


@given(merges())
def test_floor_stays_in_the_wrap_of_the_prediction(case):
    predicted, wrapped, range_m, _ = case
    merged = merge_regression(predicted, wrapped, range_m, range_m + 1)
    below = (predicted.double() / range_m).floor() * range_m
    # A prediction on a border may be rounded to either side of it.
    border = (predicted.double() / range_m - (predicted.double() / range_m).round()).abs() < 1e-5
    inside = (merged >= below - METRES) & (merged <= below + range_m + METRES)
    assert bool((inside | border).all())


@given(merges())
def test_a_farther_prediction_never_brings_a_nearer_distance(case):
    predicted, wrapped, range_m, _ = case
    farther = predicted + predicted.flip(-1) / 2
    for merge in (merge_nearest, merge_regression):
        before, after = (merge(p, wrapped, range_m, range_m + 1) for p in (predicted, farther))
        assert bool((after >= before - METRES).all())


@given(merges(), st.integers(1, 8))
def test_wraps_of_the_prediction_are_wraps_of_the_distance(case, wraps):
    predicted, wrapped, range_m, _ = case
    # Away from where rounding decides, and from where no nearer candidate is left.
    turned = (predicted.double() - wrapped) / range_m
    clear = ((turned - turned.floor() - 0.5).abs() > 1e-4) & (turned > -0.5)
    one, other = (
        merge_nearest(p, wrapped, range_m, range_m + 1)
        for p in (predicted, predicted + wraps * range_m)
    )
    moved = (other.double() - one)[clear]
    torch.testing.assert_close(moved, torch.full_like(moved, wraps * range_m), rtol=0, atol=METRES)


@given(merges())
def test_merging_what_was_merged_changes_nothing(case):
    predicted, wrapped, range_m, saturation_m = case
    once = merge_nearest(predicted, wrapped, range_m, saturation_m)
    assert torch.equal(merge_nearest(once, wrapped, range_m, saturation_m), once)


@given(merges())
def test_a_truth_within_half_a_range_of_the_prediction_comes_back(case):
    truth, _, range_m, _ = case
    error = (truth.flip(0) / FARTHEST_M - 0.5) * 0.998 * range_m
    wrapped = torch.remainder(truth.double(), range_m)
    predicted = (truth + error).clamp(min=0)
    merged = merge_nearest(predicted, wrapped.float(), range_m, range_m + 1)
    torch.testing.assert_close(merged, truth, rtol=0, atol=METRES)


@given(merges())
def test_classes_are_wraps(case):
    predicted, wrapped, range_m, saturation_m = case
    wraps = (predicted / range_m).floor()
    merged = merge_segmentation(wraps, wrapped, range_m, saturation_m)
    middle = (wraps + 0.5) * range_m
    trusted = wrapped < saturation_m
    same = merge_regression(middle, wrapped, range_m, saturation_m)
    torch.testing.assert_close(merged[trusted], same[trusted], rtol=0, atol=METRES)
    torch.testing.assert_close(merged[~trusted], wraps[~trusted] * range_m, rtol=0, atol=METRES)


@given(merges(), st.sampled_from(list(RULES)))
def test_nothing_is_written_and_nothing_shared(case, rule):
    predicted, wrapped, range_m, saturation_m = case
    kept = predicted.clone(), wrapped.clone()
    merged = RULES[rule].of_tensors(predicted, wrapped, range_m, saturation_m)
    merged.add_(1.0)
    assert torch.equal(predicted, kept[0]) and torch.equal(wrapped, kept[1])


words = arrays(np.int16, (1, 8, *PIXELS), elements=st.integers(-2048, 2047))


@given(
    words,
    predictions,
    arrays(np.bool_, (1, *PIXELS)),
    st.sampled_from([2, 4, 8]),
    st.sampled_from(list(RULES)),
    st.floats(0, 3.0),
)
def test_loops_give_what_array_operations_give(dcs, predicted, saturated, count, rule, min_snr):
    sensor = SensorDescription(min_snr=min_snr)
    range_m = unambiguous_range_m(sensor.f1_hz)
    raw = RawFrame(torch.from_numpy(dcs[:, :count].astype(np.float32)), torch.from_numpy(saturated))
    guess = torch.from_numpy(predicted).unsqueeze(0)
    looped = correct(raw, guess, sensor, merge=rule)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(correction, "_can_loop", lambda *maps: False)
        chained = correct(raw, guess, sensor, merge=rule)
    assert torch.equal(looped.amplitude, chained.amplitude)
    near = near_a_border(raw, guess, looped.wrapped_m, sensor)
    assert bool((near | (looped.valid == chained.valid)).all())
    apart = (looped.distance_m - chained.distance_m).abs()
    assert bool((near | (apart < 2 * METRES)).all())
    # Where rounding decides, both are still candidates of the same phase, or the prediction.
    wraps = apart / range_m
    whole = (wraps - wraps.round()).abs() * range_m < 2 * METRES
    either = (looped.distance_m == guess) | (chained.distance_m == guess)
    assert count == 8 or bool((whole | either).all())


def near_a_border(raw, guess, wrapped_m, sensor):
    """Where a last bit may decide: between candidates, wraps, trust, agreement or strength."""
    range_m = unambiguous_range_m(sensor.f1_hz)
    places = [(guess - wrapped_m) / range_m - 0.5, guess / range_m, wrapped_m / range_m]
    places += [(wrapped_m - sensor.saturation_range_m) / range_m]
    near = torch.zeros_like(wrapped_m, dtype=torch.bool)
    for turned in places:
        near |= (turned - turned.round()).abs() < METRES
    for start in range(0, raw.dcs_lsb.shape[1], 4):
        dcs = raw.dcs_lsb[:, start : start + 4].double()
        scale = 1.0 if dcs.shape[1] == 2 else 2.0
        quadratures = dcs if dcs.shape[1] == 2 else dcs[:, :2] - dcs[:, 2:]
        strength = quadratures.square().sum(1).sqrt() / scale
        near |= (strength - sensor.min_snr * sensor.noise_lsb).abs() < METRES
    if raw.dcs_lsb.shape[1] == 8:
        near |= frequencies_tie(raw, sensor)
    return near


def frequencies_tie(raw, sensor):
    """Where two candidates of f1 fit f2 alike, the range ends, or f2 just agrees."""
    ranges_m = [unambiguous_range_m(f) for f in (sensor.f1_hz, sensor.f2_hz)]
    dcs = raw.dcs_lsb.double()
    wrapped = [
        torch.atan2(dcs[:, k + 1] - dcs[:, k + 3], dcs[:, k] - dcs[:, k + 2]) / (2 * np.pi) % 1 * r
        for k, r in zip((0, 4), ranges_m, strict=True)
    ]
    apart = []
    for n in range(int(sensor.max_range_m / ranges_m[0]) + 1):
        turned = (wrapped[0] + n * ranges_m[0] - wrapped[1]) / ranges_m[1]
        off = (turned - turned.round()).abs() * ranges_m[1]
        beyond = wrapped[0] + n * ranges_m[0] >= sensor.max_range_m
        apart.append(torch.where(beyond, torch.full_like(off, 1e3), off))
    ordered = torch.stack(apart).sort(0).values
    ends = (wrapped[0] - sensor.max_range_m % ranges_m[0]).abs() < METRES
    rounded = (wrapped[0] < METRES) | (wrapped[0] > ranges_m[0] - METRES)
    ties = (ordered[1] - ordered[0]) < 10 * METRES
    agrees = (ordered[0] - sensor.max_residual_m).abs() < 10 * METRES
    return ties | ends | agrees | rounded
