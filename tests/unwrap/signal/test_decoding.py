"""Samples to phase: the sample model inverted, a slow reference, refusals."""

import math

import pytest
import torch

from unwrap.signal.decoding import TWO_PI, decode, distance_m
from unwrap.signal.frequencies import unambiguous_range_m


def samples_of(phase, amplitude, count):
    steps = torch.arange(count) * (math.pi / 2)
    return (amplitude * torch.cos(phase - steps[:, None, None])).float()


def decode_slowly(dcs):
    """One pixel at a time, in plain Python."""
    count, height, width = dcs.shape
    phase, amplitude = torch.empty(height, width), torch.empty(height, width)
    for y in range(height):
        for x in range(width):
            d = dcs[:, y, x].double().tolist()
            sine, cosine = (d[1], d[0]) if count == 2 else (d[1] - d[3], d[0] - d[2])
            phase[y, x] = math.atan2(sine, cosine) % TWO_PI
            amplitude[y, x] = math.hypot(sine, cosine) / (1 if count == 2 else 2)
    return phase, amplitude


@pytest.mark.parametrize("count", [2, 4])
def test_equals_the_slow_reference(count):
    dcs = 100 * torch.randn(count, 16, 16, generator=torch.Generator().manual_seed(3))
    frame = decode(dcs)
    phase, amplitude = decode_slowly(dcs)
    torch.testing.assert_close(frame.phase_rad, phase, rtol=0, atol=2e-6)
    torch.testing.assert_close(frame.amplitude, amplitude)


@pytest.mark.parametrize("count", [2, 4])
def test_inverts_the_sample_model(count):
    phase = torch.linspace(0.001, TWO_PI - 0.001, 12 * 16, dtype=torch.float64).reshape(12, 16)
    frame = decode(samples_of(phase, 250.0, count))
    torch.testing.assert_close(frame.phase_rad.double(), phase, rtol=0, atol=1e-6)
    torch.testing.assert_close(frame.amplitude, torch.full((12, 16), 250.0))


@pytest.mark.parametrize("sine", [0.0, -0.0, -1e-30, -1e-6, 1e-30])
def test_phase_stays_below_two_pi(sine):
    phase = decode(torch.tensor([1.0, sine]).reshape(2, 1, 1)).phase_rad
    assert 0 <= float(phase) < TWO_PI
    assert math.cos(float(phase)) == pytest.approx(1)


def test_no_signal_has_a_finite_phase():
    frame = decode(torch.zeros(4, 2, 2))
    assert torch.equal(frame.phase_rad, torch.zeros(2, 2))
    assert torch.equal(frame.amplitude, torch.zeros(2, 2))


def test_offset_cancels_in_four_samples_and_is_subtracted_from_two():
    phase = torch.linspace(0.1, 6.1, 64).reshape(8, 8)
    offset = torch.linspace(-40, 40, 64).reshape(8, 8)
    four = samples_of(phase, 100.0, 4)
    torch.testing.assert_close(decode(four + offset).phase_rad, phase, rtol=0, atol=1e-5)
    two = four[:2] + offset
    # Without the map it is wrong, so that the last line proves something.
    assert (decode(two).phase_rad - phase).abs().max() > 0.1
    torch.testing.assert_close(decode(two, offset_lsb=offset).phase_rad, phase, rtol=0, atol=1e-5)


def test_residual_tells_a_moved_pixel_only_with_four_samples():
    dcs = samples_of(torch.full((1, 2), 1.0), 100.0, 4)
    dcs[2, 0, 1] += 30
    residual = decode(dcs).residual
    torch.testing.assert_close(residual, torch.tensor([[0.0, 30.0]]), atol=1e-4, rtol=0)
    assert decode(dcs[:2]).residual is None


def test_batch_dimensions_are_kept_and_the_input_is_not_written():
    dcs = torch.randn(5, 3, 4, 6, 7)  # Two leading axes.
    before = dcs.clone()
    frame = decode(dcs)
    assert frame.phase_rad.shape == frame.amplitude.shape == frame.residual.shape == (5, 3, 6, 7)
    assert torch.equal(dcs, before)


def test_large_but_finite_samples_pass():
    # Their sum and their squares overflow to infinity, which must not pass for a bad sample.
    assert decode(torch.full((2, 300, 300), 1e35)).phase_rad.isfinite().all()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_refuses_what_is_not_finite_and_says_where(value):
    dcs = torch.zeros(1, 4, 5, 6)
    dcs[0, 2, 3, 4] = value
    with pytest.raises(ValueError, match=r"dcs holds .* at \[0, 2, 3, 4\]"):
        decode(dcs)


@pytest.mark.parametrize(
    "dcs",
    [torch.zeros(3, 4, 4), torch.zeros(8, 4, 4), torch.zeros(4, 4), torch.zeros(2, 4, 4).long()],
)
def test_refuses_other_shapes_and_types(dcs):
    with pytest.raises(ValueError, match="dcs"):
        decode(dcs)


def test_distance_of_a_period_is_the_unambiguous_range():
    assert unambiguous_range_m(24e6) == pytest.approx(6.2457, abs=1e-4)
    assert unambiguous_range_m(10e6) == pytest.approx(14.990, abs=1e-3)
    assert float(distance_m(torch.tensor(TWO_PI), 24e6)) == pytest.approx(6.2457, abs=1e-4)
