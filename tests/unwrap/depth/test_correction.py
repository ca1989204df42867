"""What samples and a prediction become: merge rules, validity, offset, noise, refusals."""

from dataclasses import replace

import pytest
import torch
from raw_frames import RANGE_M, SENSOR, raw_frame

from unwrap.depth.correction import correct, correct_sensed
from unwrap.signal.frames import RawFrame
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.signal.sensed import Sensed


@pytest.fixture
def truth():
    return torch.linspace(0.05, 24.95, 2 * 20 * 30, dtype=torch.float64).reshape(2, 20, 30)


@pytest.mark.parametrize("merge", ["nearest", "floor"])
@pytest.mark.parametrize("count", [2, 4])
def test_few_samples_and_a_perfect_prediction_give_the_truth(truth, count, merge):
    frame = correct(raw_frame(truth, count), truth.float(), SENSOR, merge=merge)
    # Within 6 cm of a wrap the rounding of the phase may change the side, and eq. 6 the wrap.
    away = (truth % RANGE_M - RANGE_M / 2).abs() < RANGE_M / 2 - 0.06
    torch.testing.assert_close(frame.distance_m[away], truth[away].float(), rtol=0, atol=1e-3)
    assert torch.equal(frame.wraps[away], (truth[away] / RANGE_M).long())
    assert frame.valid.all()


@pytest.mark.parametrize("count", [2, 4])
def test_unmerged_the_prediction_stands_and_is_not_written_to(truth, count):
    raw, predicted_m = raw_frame(truth, count), truth.float() + 0.3
    before = predicted_m.clone()
    frame = correct(raw, predicted_m, SENSOR, merge="none")
    assert torch.equal(frame.distance_m, before)
    assert frame.valid.all()
    eight = correct(raw_frame(truth, 8), predicted_m, SENSOR, merge="none")
    torch.testing.assert_close(eight.distance_m, truth.float(), rtol=0, atol=1e-3)
    assert torch.equal(predicted_m, before)


def test_eight_samples_need_no_prediction(truth):
    frame = correct(raw_frame(truth, 8), None, SENSOR)
    torch.testing.assert_close(frame.distance_m, truth.float(), rtol=0, atol=1e-3)
    assert frame.valid.all()


def test_invalid_pixels_hold_the_prediction_or_nan(truth):
    raw = raw_frame(truth, 8)
    raw.saturated[0, 0, 0] = True
    raw.dcs_lsb[0, :, 0, 1] *= 0.001  # Too weak.
    guessed = correct(raw, torch.full(truth.shape, 9.0), SENSOR)
    assert guessed.valid.sum() == truth.numel() - 2
    assert guessed.distance_m[0, 0, :2].tolist() == [9.0] * 2
    assert guessed.wraps[0, 0, :2].tolist() == [1] * 2
    unknown = correct(raw, None, SENSOR)
    assert unknown.distance_m[0, 0, :2].isnan().all()
    assert torch.equal(unknown.valid, guessed.valid)


def test_where_the_frequencies_disagree_the_prediction_decides(truth):
    raw = raw_frame(truth, 8)
    raw.dcs_lsb[0, 4:, 0, 2] = raw_frame(truth + 1.2, 8).dcs_lsb[0, 4:, 0, 2]
    unambiguous = unambiguous_range_m(SENSOR.f1_hz)
    second_wrap = truth.float() + unambiguous
    frame = correct(raw, second_wrap, SENSOR)
    expected = truth[0, 0, 2].item() + unambiguous
    assert frame.distance_m[0, 0, 2].item() == pytest.approx(expected, abs=1e-3)
    assert frame.valid.all()
    others = torch.ones_like(truth, dtype=torch.bool)
    others[0, 0, 2] = False
    torch.testing.assert_close(frame.distance_m[others], truth.float()[others], rtol=0, atol=1e-3)
    alone = correct(raw, None, SENSOR)
    assert not alone.valid[0, 0, 2] and alone.valid[others].all()


def test_noise_map_decides_what_is_valid(truth):
    noise = torch.where(truth < 10, 60.0, 100.0)
    frame = correct(raw_frame(truth, 4), truth.float(), SENSOR, noise_lsb=noise)
    assert torch.equal(frame.valid, truth < 10)


def test_offset_map_is_subtracted(truth):
    offset = torch.linspace(-50, 50, 20 * 30).reshape(20, 30)
    raw = raw_frame(truth, 2)
    shifted = RawFrame(raw.dcs_lsb + offset, raw.saturated)
    frame = correct(shifted, truth.float(), SENSOR, offset_lsb=offset)
    expected = correct(raw, truth.float(), SENSOR)
    torch.testing.assert_close(frame.distance_m, expected.distance_m, rtol=0, atol=1e-3)


def test_correct_refuses_what_it_cannot_do(truth):
    with pytest.raises(ValueError, match="predicted_m is None"):
        correct(raw_frame(truth, 4), None, SENSOR)
    with pytest.raises(ValueError, match="merge is 'ceil'"):
        correct(raw_frame(truth, 4), truth, SENSOR, merge="ceil")


def test_sensed_frames_are_corrected_with_all_that_is_known_of_them(truth):
    raw, gray = raw_frame(truth, 2), torch.zeros(truth.shape)
    noise, shift = torch.full(truth.shape, 9.0), torch.tensor([0.3, -0.2])
    offset = torch.linspace(-50, 50, 20 * 30).reshape(20, 30).expand(truth.shape)
    found = correct_sensed(Sensed(gray, raw, offset, noise, shift), truth.float(), SENSOR)
    expected = correct(
        raw, truth.float(), SENSOR, offset_lsb=offset, noise_lsb=noise, shift_m=shift
    )
    assert torch.equal(found.distance_m, expected.distance_m)
    assert torch.equal(found.valid, expected.valid)
    with pytest.raises(ValueError, match=r"sensed\.raw is None"):
        correct_sensed(Sensed(gray), truth.float(), SENSOR)


EIGHT = ("two_frequency", "kernel_density", "network")


@pytest.mark.parametrize("eight", EIGHT)
def test_without_noise_all_ways_of_eight_samples_give_the_truth(eight):
    truth = torch.linspace(2.0, 22.0, 20 * 30, dtype=torch.float64).reshape(1, 20, 30)
    frame = correct(raw_frame(truth, 8), truth.float(), SENSOR, eight=eight)
    torch.testing.assert_close(frame.distance_m, truth.float(), rtol=0, atol=2e-3)
    assert frame.valid.all()


def test_the_network_decides_every_wrap_of_eight_samples(truth):
    raw, other = raw_frame(truth, 8), truth.float() + RANGE_M
    frame = correct(raw, other, SENSOR, eight="network")
    expected = correct(raw_frame(truth, 4), other, SENSOR)
    assert torch.equal(frame.distance_m, expected.distance_m)
    assert torch.equal(frame.valid, expected.valid)
    with pytest.raises(ValueError, match="expected a prediction for eight"):
        correct(raw, None, SENSOR, eight="network")


def test_where_the_vote_is_not_confident_the_prediction_decides(truth):
    # Every wrapped distance is trusted here, so that no guess stands for one near its end.
    sensor = replace(SENSOR, saturation_range_m=7.0)
    raw = raw_frame(truth, 8)
    raw.dcs_lsb[:, 4:] = raw_frame(truth + 1.25, 8).dcs_lsb[:, 4:]  # Frequencies at odds.
    raw.saturated[0, 0, 0] = True
    alone = correct(raw, None, sensor, eight="kernel_density")
    assert not alone.valid.any() and alone.distance_m.isnan().all()
    guess_m = truth.float() + 0.1
    frame = correct(raw, guess_m, sensor, eight="kernel_density")
    assert frame.valid.sum() == truth.numel() - 1
    assert frame.distance_m[0, 0, 0] == guess_m[0, 0, 0]
    torch.testing.assert_close(
        frame.distance_m[frame.valid], truth.float()[frame.valid], rtol=0, atol=2e-3
    )


def test_in_noise_neighbours_tell_wraps_better_than_each_pixel_alone():
    truth = torch.linspace(10.0, 14.0, 40).expand(1, 30, 40)
    raw = raw_frame(truth, 8, amplitude=8.0)
    noise = torch.randn(raw.dcs_lsb.shape, generator=torch.Generator().manual_seed(5))
    noisy = RawFrame(raw.dcs_lsb + 2.0 * noise, raw.saturated)
    wrong = {}
    for eight in EIGHT[:2]:
        guess = torch.zeros_like(truth)  # Tells nothing: what is left to it is wrong.
        found = correct(noisy, guess, SENSOR, eight=eight, noise_lsb=2.0).distance_m
        wrong[eight] = int(((found - truth).abs() > RANGE_M / 2).sum())
    assert wrong["two_frequency"] > 100
    assert wrong["kernel_density"] < 0.5 * wrong["two_frequency"]


def test_an_unknown_way_of_eight_samples_is_named(truth):
    with pytest.raises(ValueError, match="eight is 'vote'; expected one of two_frequency"):
        correct(raw_frame(truth, 8), truth.float(), SENSOR, eight="vote")
