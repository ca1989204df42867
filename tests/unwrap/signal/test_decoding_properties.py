"""Decoding, for whatever samples: closed forms, prefixes, shifts by whole wraps, scales, turns."""

from __future__ import annotations

import math

import numpy as np
import torch
from hypothesis import given, strategies as st
from hypothesis.extra.numpy import arrays

from unwrap.signal.calibrated import decode_at
from unwrap.signal.decoding import (
    BELOW_TWO_PI,
    TWO_PI,
    _by_loop,
    _by_torch,
    angle_rad,
    decode,
    distance_m,
)
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.frequencies import unambiguous_range_m
from unwrap.signal.shots import demodulation_phase_rad, harmonic_weights
from unwrap.signal.wiggle import WiggleTable, wiggle_of, wrap_phase
from unwrap.signal.words import from_words, to_words

PIXELS = (2, 3)
WIGGLE = (wiggle_of(harmonic_weights(1.0, 7)), wiggle_of(harmonic_weights(0.5, 5)))
# Tolerances are of float32, whose turns near 2 are exact to 1.2e-7, which is 7.5e-7 rad.
PHASE_RAD = 3e-6


def floats(low: float, high: float, width: int = 32) -> st.SearchStrategy[float]:
    """Numbers of that many bits in an interval, whose ends are rounded inwards."""
    if width == 32:
        low = float(np.nextafter(np.float32(low), np.float32(np.inf)))
        high = float(np.nextafter(np.float32(high), np.float32(-np.inf)))
    return st.floats(low, high, width=width, allow_subnormal=False)


def samples(count: int, largest: float = 2047.0) -> st.SearchStrategy[torch.Tensor]:
    """Samples [count, H, W] of any kind that a converter may give."""
    return arrays(np.float32, (count, *PIXELS), elements=floats(-largest, largest)).map(
        torch.from_numpy
    )


phases = arrays(np.float64, PIXELS, elements=st.floats(0.0, TWO_PI, exclude_max=True))
amplitudes = arrays(np.float64, PIXELS, elements=st.floats(1.0, 2000.0))
frequencies = st.floats(1e6, 200e6)


def turned(found: torch.Tensor, expected: torch.Tensor | np.ndarray) -> float:
    """Largest distance of phases on the circle, radians."""
    difference = found.double() - torch.as_tensor(expected, dtype=torch.float64)
    return float(torch.remainder(difference + math.pi, TWO_PI).sub(math.pi).abs().max())


def sampled(phase: np.ndarray, amplitude: np.ndarray, count: int) -> torch.Tensor:
    """The closed form: D_k = A cos(phi - theta_k)."""
    steps = [amplitude * np.cos(phase - demodulation_phase_rad(k)) for k in range(count)]
    return torch.from_numpy(np.stack(steps).astype(np.float32))


@given(phases, amplitudes, st.sampled_from([2, 4]))
def test_the_closed_form_is_inverted(phase, amplitude, count):
    frame = decode(sampled(phase, amplitude, count))
    assert turned(frame.phase_rad, phase) <= PHASE_RAD
    np.testing.assert_allclose(frame.amplitude.numpy(), amplitude, rtol=1e-6)
    assert count == 2 or float((frame.residual / frame.amplitude).max()) < 1e-6


@given(samples(8), st.booleans())
def test_eight_samples_have_the_phase_of_their_first_four(dcs, calibrated):
    sensor = SensorDescription(wiggle=WIGGLE if calibrated else None)
    full = torch.zeros(1, *PIXELS, dtype=torch.bool)
    eight, four = (decode_at(0, RawFrame(d.unsqueeze(0), full), sensor) for d in (dcs, dcs[:4]))
    for name in ("phase_rad", "amplitude", "residual"):
        assert torch.equal(getattr(eight, name), getattr(four, name))


@given(phases, amplitudes)
def test_two_and_four_samples_of_still_light_have_one_phase(phase, amplitude):
    four = sampled(phase, amplitude, 4)
    assert turned(decode(four[:2]).phase_rad, decode(four).phase_rad) <= PHASE_RAD


@given(samples(4), st.integers(-(2**20), 2**20))
def test_an_offset_of_all_four_samples_changes_nothing(dcs, offset):
    words = dcs.round()  # of whole numbers the sum is exact
    plain, moved = decode(words), decode(words + offset)
    assert torch.equal(plain.phase_rad, moved.phase_rad)
    assert torch.equal(plain.amplitude, moved.amplitude)


@given(samples(2), st.integers(-2048, 2047))
def test_a_stored_offset_is_taken_off_two_samples(dcs, offset):
    words = dcs.round()
    stored = torch.full(PIXELS, float(offset))
    plain, corrected = decode(words), decode(words + offset, offset_lsb=stored)
    assert torch.equal(plain.phase_rad, corrected.phase_rad)


@given(samples(4), st.integers(-20, 40), st.sampled_from([2, 4]))
def test_a_power_of_two_scales_the_amplitude_and_no_bit_of_the_phase(dcs, power, count):
    # From 1/8 LSB on, so that no product is below what a float has.
    dcs = torch.where(dcs.abs() < 0.125, torch.zeros(()), dcs)[:count]
    one, scaled = decode(dcs), decode(dcs * 2.0**power)
    assert torch.equal(one.phase_rad, scaled.phase_rad)
    assert torch.equal(one.amplitude * 2.0**power, scaled.amplitude)


@given(phases, amplitudes, floats(1e-3, 1e3), st.sampled_from([2, 4]))
def test_any_scale_leaves_the_phase(phase, amplitude, scale, count):
    dcs = sampled(phase, amplitude, count)
    one, scaled = decode(dcs), decode(dcs * scale)
    assert turned(one.phase_rad, scaled.phase_rad) <= PHASE_RAD
    torch.testing.assert_close(one.amplitude * scale, scaled.amplitude, rtol=1e-6, atol=0)


@given(samples(4), st.integers(1, 3))
def test_samples_in_another_order_are_another_phase(dcs, steps):
    """Light that comes a quarter of a period later gives each sample to the next."""
    strong = (dcs[0] - dcs[2]).abs() + (dcs[1] - dcs[3]).abs() > 1e-3
    later = decode(dcs.roll(steps, 0)).phase_rad[strong]
    if strong.any():
        assert turned(later, decode(dcs).phase_rad[strong] + steps * math.pi / 2) <= PHASE_RAD


@given(samples(8), st.integers(-1000, 1000), floats(0.0, 6.0, 64), st.sampled_from([0, 1]))
def test_a_shift_by_whole_wraps_changes_nothing(dcs, wraps, shift_m, frequency):
    sensor = SensorDescription(wiggle=WIGGLE)
    raw = RawFrame(dcs.unsqueeze(0), torch.zeros(1, *PIXELS, dtype=torch.bool))
    range_m = unambiguous_range_m((sensor.f1_hz, sensor.f2_hz)[frequency])

    def shifted(metres: float) -> torch.Tensor:
        shift = torch.tensor([metres], dtype=torch.float64)
        return decode_at(frequency, raw, sensor, shift_m=shift).phase_rad

    assert turned(shifted(shift_m + wraps * range_m), shifted(shift_m)) <= PHASE_RAD
    unshifted = decode_at(frequency, raw, sensor).phase_rad
    assert turned(shifted(shift_m), unshifted + TWO_PI * shift_m / range_m) <= PHASE_RAD


@given(samples(4, 1e15), frequencies, st.sampled_from([2, 4]))
def test_phases_lie_in_a_period_and_distances_in_a_range(dcs, frequency, count):
    frame = decode(dcs[:count])
    assert float(frame.phase_rad.min()) >= 0 and float(frame.phase_rad.max()) <= BELOW_TWO_PI
    assert bool(frame.amplitude.isfinite().all()) and float(frame.amplitude.min()) >= 0
    metres = distance_m(torch.tensor([0.0, BELOW_TWO_PI]), frequency)
    assert metres[0] == 0 and float(metres[1]) <= unambiguous_range_m(frequency) * (1 + 1e-7)


@given(arrays(np.float32, PIXELS, elements=floats(-1e6, 1e6)))
def test_a_wrapped_phase_lies_in_a_period(phase):
    wrapped = wrap_phase(torch.from_numpy(phase))
    assert float(wrapped.min()) >= 0 and float(wrapped.max()) < TWO_PI
    # A float near 1e6 is exact to .06 rad; the wrapping adds no more than that.
    spacing = float(np.spacing(np.abs(phase).max()))
    assert turned(wrapped, phase) <= 2 * spacing + 1e-6


@given(
    arrays(np.float32, 6, elements=floats(-1e4, 1e4)),
    arrays(np.float32, 6, elements=floats(-1e4, 1e4)),
)
def test_the_compiled_angle_is_the_arc_tangent(sine, cosine):
    found = angle_rad(torch.from_numpy(sine), torch.from_numpy(cosine)).numpy()
    # Of numbers below 1e-30, which are no samples, nothing is promised but an angle.
    sound = np.maximum(np.abs(sine), np.abs(cosine)) > 1e-30
    expected = np.arctan2(sine.astype(np.float64), cosine.astype(np.float64))
    np.testing.assert_allclose(found[sound], expected[sound], rtol=0, atol=3e-7)
    assert np.all(np.abs(found) <= np.float32(np.pi))


@given(samples(4), st.sampled_from([2, 4]), st.booleans())
def test_the_compiled_quadratures_are_those_of_torch(dcs, count, with_offset):
    dcs = dcs[:count]
    offset = dcs[0].flip(-1) / 8 if with_offset else None
    for looped, chained in zip(_by_loop(dcs, offset), _by_torch(dcs, offset), strict=True):
        if looped is None or chained is None:
            assert looped is chained and count == 2
        else:
            torch.testing.assert_close(looped, chained, rtol=1e-6, atol=1e-6)


@given(
    st.lists(st.floats(-0.1, 0.1), min_size=4, max_size=64),
    arrays(np.float32, PIXELS, elements=floats(0, BELOW_TWO_PI)),
)
def test_a_table_of_errors_removes_what_it_tells(errors, phase):
    """Linear between its entries and periodic, by NumPy's own interpolation."""
    count = len(errors)
    table = WiggleTable(tuple(errors))
    places = np.arange(count + 1) * TWO_PI / count
    told = np.interp(phase.astype(np.float64), places, [*errors, errors[0]])
    frame = decode(sampled(phase.astype(np.float64), np.ones(PIXELS), 4))
    corrected = table.corrected(frame).phase_rad
    # A bin is some .1 rad, over which the error changes by up to .2: the slope makes more of what
    # the phase is off by.
    assert turned(corrected, phase.astype(np.float64) - told) <= PHASE_RAD * (1 + count / 30)


@given(arrays(np.int32, (1, 4, *PIXELS), elements=st.integers(0, 4095)))
def test_words_come_back(words):
    raw = from_words(torch.from_numpy(words))
    assert torch.equal(to_words(raw.dcs_lsb), torch.from_numpy(words))
    assert torch.equal(raw.saturated, ((raw.dcs_lsb < -2047) | (raw.dcs_lsb > 2046)).any(1))
