"""Correction by compiled loops: what the chains of array operations give, pixel by pixel."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from unwrap.depth import correction
from unwrap.depth.correction import correct
from unwrap.depth.merge import NEAREST, RULES, Limits, merge_pixels
from unwrap.signal.decoding import decode, decode_pixels
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.shots import Shots, harmonic_weights
from unwrap.signal.wiggle import FLAT, wiggle_of

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
@pytest.mark.parametrize("count", [2, 4])
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
    if count == 4:
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
    with pytest.raises(RuntimeError, match="must match"):
        correct(RawFrame(raw.dcs_lsb[..., 1:], raw.saturated), predicted_m, SensorDescription())


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
            WIGGLE[0].straight,
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
