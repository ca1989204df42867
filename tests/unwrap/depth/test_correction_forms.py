"""Correction by compiled loops: what the chains of array operations give, pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from unwrap.depth import correction
from unwrap.depth.correction import correct
from unwrap.depth.merge import NEAREST, RULES, Limits, merge_pixels
from unwrap.signal.decoding import decode, decode_pixels, to_phase_, to_turns_
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import is_strong
from unwrap.signal.shots import Shots, harmonic_weights
from unwrap.signal.wiggle import FLAT, WiggleTable, shift_turns_, wiggle_of
from unwrap.support.compiled import array_of

SHAPE = (3, 12, 37)
WIGGLE = (wiggle_of(harmonic_weights(0.3, 7)), FLAT)


def drawn(count, seed=0):
    """Samples of weak and strong pixels, some of them saturated."""
    random = torch.Generator().manual_seed(seed)
    batch, *size = SHAPE
    strength = 10 ** (3 * torch.rand(batch, 1, *size, generator=random))
    dcs = (strength * torch.randn(batch, count, *size, generator=random)).round()
    return RawFrame(dcs, torch.rand(SHAPE, generator=random) < 0.1)


def maps(scale, seed=1):
    return scale * torch.rand(SHAPE, generator=torch.Generator().manual_seed(seed))


@pytest.fixture
def both(monkeypatch):
    """Corrects by loops and by array operations."""

    def run(*words, **fields):
        assert correction._can_loop(*words[:2])
        looped = correct(*words, **fields)
        with monkeypatch.context() as patch:
            patch.setattr(correction, "_can_loop", lambda *maps: False)
            return looped, correct(*words, **fields)

    return run


@pytest.mark.parametrize("merge", RULES)
@pytest.mark.parametrize("wiggle", [None, WIGGLE])
@pytest.mark.parametrize("count", [2, 4, 8])
def test_loops_equal_array_operations(both, count, wiggle, merge):
    sensor = SensorDescription(wiggle=wiggle, min_snr=1.5)
    known = {
        "offset_lsb": maps(6.0, 2) - 3.0,
        "noise_lsb": maps(40.0, 3),
        "shift_m": torch.tensor([0.1, -0.2, 9.0], dtype=torch.float64),
    }
    loops, arrays = both(drawn(count), maps(25.0), sensor, merge=merge, **known)
    assert 0.1 < loops.valid.float().mean() < 0.9
    torch.testing.assert_close(loops.amplitude, arrays.amplitude, rtol=1e-6, atol=1e-5)
    assert torch.equal(loops.valid, arrays.valid)
    # A pixel may lie within the rounding of a float of where two candidates meet.
    apart_m = (loops.distance_m - arrays.distance_m).abs()
    assert int((apart_m > 1e-5).sum()) <= 1
    # Phases are the same up to whole turns.
    turned = (loops.phase_rad - arrays.phase_rad).cos()
    torch.testing.assert_close(turned, torch.ones(SHAPE), rtol=0, atol=1e-6)
    torch.testing.assert_close(loops.wrapped_m, loops.phase_rad * (loops.unambiguous_m / math.tau))
    assert (loops.residual is None) == (count == 2)
    if count > 2:
        torch.testing.assert_close(loops.residual, arrays.residual)


@pytest.mark.parametrize("count", [2, 4])
def test_what_is_common_to_a_batch_serves_every_frame(both, count):
    sensor, common = SensorDescription(noise_lsb=20.0), maps(6.0)[0]
    loops, arrays = both(drawn(count), maps(25.0), sensor, offset_lsb=common)
    torch.testing.assert_close(loops.distance_m, arrays.distance_m, rtol=0, atol=1e-5)
    assert torch.equal(loops.valid, arrays.valid)
    shifted = both(drawn(count), maps(25.0), sensor, shift_m=torch.tensor([0.3]))
    torch.testing.assert_close(*(frame.distance_m for frame in shifted), rtol=0, atol=1e-5)


@pytest.mark.parametrize("count", [2, 4])
def test_decoding_takes_any_leading_shape(count):
    random = torch.Generator().manual_seed(4)
    dcs = torch.randn(2, 3, count, 5, 7, generator=random)
    offset = torch.randn(3, 5, 7, generator=random)
    loops, arrays = decode(dcs, offset_lsb=offset), decode(dcs.double(), offset_lsb=offset.double())
    for name in ("phase_rad", "amplitude", "residual")[: 2 + (count == 4)]:
        found, expected = getattr(loops, name), getattr(arrays, name).float()
        torch.testing.assert_close(found, expected, rtol=0, atol=2e-6)
    assert decode(dcs[0, 0]).phase_rad.shape == (5, 7)


@pytest.mark.parametrize("noise", [20, 20.0, np.float32(20), torch.tensor(20.0)])
def test_one_noise_serves_all_pixels(noise):
    raw, predicted_m = drawn(2), maps(25.0)
    found = correct(raw, predicted_m, SensorDescription(), noise_lsb=noise)
    expected = correct(raw, predicted_m, SensorDescription(), noise_lsb=torch.full(SHAPE, 20.0))
    assert torch.equal(found.valid, expected.valid)


def test_nothing_that_is_given_is_changed():
    raw, predicted_m, offset = drawn(4), maps(25.0), maps(6.0)
    before = [values.clone() for values in (raw.dcs_lsb, raw.saturated, predicted_m, offset)]
    correct(raw, predicted_m, SensorDescription(), offset_lsb=offset)
    after = (raw.dcs_lsb, raw.saturated, predicted_m, offset)
    assert all(map(torch.equal, before, after))


def test_maps_may_lie_in_memory_in_any_order():
    raw, predicted_m = drawn(2), maps(25.0)
    turned = RawFrame(*(turned_in_memory(values) for values in (raw.dcs_lsb, raw.saturated)))
    expected = correct(raw, predicted_m, SensorDescription())
    found = correct(turned, turned_in_memory(predicted_m), SensorDescription())
    assert torch.equal(found.distance_m, expected.distance_m)
    assert torch.equal(found.valid, expected.valid)


def turned_in_memory(values):
    """The same values, their columns side by side in memory instead of their rows."""
    return values.transpose(-1, -2).contiguous().transpose(-1, -2)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_an_unsound_sample_is_named(wrong):
    raw = drawn(2)
    raw.dcs_lsb[1, 0, 4, 5] = wrong
    with pytest.raises(ValueError, match=r"dcs holds (NaN|an infinity) at \[1, 0, 4, 5\]"):
        correct(raw, maps(25.0), SensorDescription())


def test_other_values_take_the_array_operations():
    raw, predicted_m = drawn(2), maps(25.0)
    assert not correction._can_loop(raw, predicted_m.double())
    assert not correction._can_loop(raw, predicted_m.requires_grad_())
    assert not correction._can_loop(raw, predicted_m[0])
    with pytest.raises(ValueError, match=r"raw\.saturated has shape"):
        correct(RawFrame(raw.dcs_lsb[..., 1:], raw.saturated), predicted_m, SensorDescription())


def merged(angle_rad, *, turns_table=FLAT.turns_table, shift_turns=0.0, amplitude=1.0, noise=1.0):
    """Phase and validity of the compiled loop for angles [n]; the distance is the prediction."""
    shape = (1, 1, len(angle_rad))
    phase_rad, distance_m = angle_rad.numpy().copy().reshape(shape), np.zeros(shape, np.float32)
    valid = np.zeros(shape, np.bool_)
    merge_pixels(
        phase_rad,
        turns_table,
        np.float32([shift_turns]),
        array_of(amplitude, shape),
        array_of(noise, shape),
        np.zeros(shape, np.bool_),
        np.full(shape, 7.0, np.float32),
        Limits(*map(np.float32, (6.25, 6.2, 3.0))),
        RULES["none"].branch,
        distance_m,
        valid,
    )
    assert (distance_m == 7).all()
    return torch.from_numpy(phase_rad).flatten(), torch.from_numpy(valid).flatten()


def apart_rad(one, other):
    """Difference of phases, up to whole turns."""
    return (one.double() - other.double() + math.pi).remainder(math.tau).sub(math.pi).abs()


@pytest.mark.parametrize("errors", [(0.0,) * 4, (0.0, 0.1, -0.2, 0.3, 0.2), WIGGLE[0].error_rad])
def test_the_loop_s_turns_are_those_of_the_wiggle_table(errors):
    """At the entries of the table, on both sides of them, and at the ends."""
    table = WiggleTable(errors)
    entries = torch.arange(-len(errors) // 2, len(errors) // 2 + 1) * (math.tau / len(errors))
    beside = torch.cat([entries + step for step in (0.0, -1e-6, 1e-6, 0.01)])
    ends = torch.tensor([-math.pi, math.pi, -0.0, 1e-30, -1e-30])
    angle_rad = torch.cat((beside, ends)).clamp(-math.pi, math.pi)
    found, _ = merged(angle_rad, turns_table=table.turns_table)
    assert found.min() >= 0 and found.max() < math.tau
    assert apart_rad(found, to_phase_(table.turns_of(angle_rad))).max() < 3e-6


@pytest.mark.parametrize("shift_m", [0.0, 0.4, -0.4, 6.2, 99.0])
def test_the_loop_s_shift_is_that_of_shift_turns(both, shift_m):
    angle_rad = torch.linspace(-3.1, 3.1, 100)
    frequency_hz, shift = 24e6, torch.tensor([shift_m], dtype=torch.float64)
    turns = shift_turns_(to_turns_(angle_rad.clone()).view(1, 1, -1), shift, frequency_hz)
    samples = torch.stack((angle_rad.cos(), angle_rad.sin())).view(1, 2, 1, -1)
    raw = RawFrame(samples, torch.zeros(1, 1, 100, dtype=torch.bool))
    looped, arrays = both(raw, torch.zeros(1, 1, 100), SensorDescription(), shift_m=shift)
    for frame in (looped, arrays):
        assert apart_rad(frame.phase_rad, to_phase_(turns.clone())).max() < 3e-6


def test_the_loop_s_strong_pixels_are_those_of_is_strong():
    """At the limit itself, and one float to either side."""
    noise = torch.tensor([0.5, 1.0, 1.7, 12.3, 0.0, 0.0])
    limit = 3.0 * noise
    for amplitude in (
        limit,
        torch.nextafter(limit, torch.tensor(torch.inf)),
        torch.nextafter(limit, torch.tensor(0.0)),
    ):
        _, found = merged(torch.zeros(6), amplitude=amplitude, noise=noise)
        assert torch.equal(found, is_strong(amplitude, noise, SensorDescription(min_snr=3.0)))


def test_loops_equal_their_python():
    """Compiled or not: the rules of IEEE 754, in the order written."""
    raw, found = drawn(Shots.FOUR), []
    for walk, merge in (
        (decode_pixels, merge_pixels),
        (decode_pixels.py_func, merge_pixels.py_func),
    ):
        made = np.zeros((5, *SHAPE), np.float32)
        valid = np.zeros(SHAPE, np.bool_)
        assert walk(raw.dcs_lsb.numpy(), maps(6.0).numpy(), *made[:4])
        angle_rad = np.arctan2(made[1], made[0])
        merge(
            angle_rad,
            WIGGLE[0].turns_table,
            np.float32([0.0, 0.4, 0.9]),
            made[2],
            maps(40.0).numpy(),
            raw.saturated.numpy(),
            maps(25.0).numpy(),
            Limits(*map(np.float32, (6.25, 6.2, 1.0))),
            NEAREST,
            made[4],
            valid,
        )
        found.append((made, angle_rad, valid))
    for compiled, python in zip(*found, strict=True):
        np.testing.assert_array_equal(compiled, python)
