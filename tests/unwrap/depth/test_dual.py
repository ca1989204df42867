"""Two-frequency unwrapping against a slow reference, and its errors in noise."""

import math

import pytest
import torch

from unwrap.depth.dual import unwrap_dual
from unwrap.signal.decoding import TWO_PI
from unwrap.signal.frequencies import unambiguous_range_m

F1, F2 = 24e6, 10e6


def phase_of(distance, frequency):
    return (4 * math.pi * frequency * distance / 299_792_458.0 % TWO_PI).float()


def unwrap_slowly(phase1, phase2, max_range_m, f1, f2):
    """Every pair of wrap counts of one pixel at a time, in plain Python."""
    range1, range2 = unambiguous_range_m(f1), unambiguous_range_m(f2)
    distance, residual = torch.empty_like(phase1), torch.empty_like(phase1)
    for index in range(phase1.numel()):
        wrapped1 = float(phase1.view(-1)[index]) / TWO_PI * range1
        wrapped2 = float(phase2.view(-1)[index]) / TWO_PI * range2
        pairs = [
            (abs(wrapped1 + n * range1 - wrapped2 - m * range2), n, m)
            for n in range(40)
            for m in range(-1, 10)
            if n == 0 or wrapped1 + n * range1 <= max_range_m
        ]
        gap, n, m = min(pairs)
        one, two = wrapped1 + n * range1, wrapped2 + m * range2
        fused = (one * f1**2 + two * f2**2) / (f1**2 + f2**2)
        distance.view(-1)[index], residual.view(-1)[index] = max(0.0, fused), gap
    return distance, residual


@pytest.mark.parametrize(
    ("max_range_m", "f1", "f2"),
    [
        (5.0, F1, F2),
        (15.0, F1, F2),
        (25.0, F1, F2),
        (74.0, F1, F2),
        (25.0, 60e6, 25e6),
        (37.0, 100e6, 31e6),
    ],
)
def test_equals_the_slow_reference(max_range_m, f1, f2):
    generator = torch.Generator().manual_seed(7)
    phase1, phase2 = TWO_PI * torch.rand(2, 16, 16, generator=generator)
    fast = unwrap_dual(phase1, phase2, f1, f2, max_range_m=max_range_m)
    slow = unwrap_slowly(phase1, phase2, max_range_m, f1, f2)
    torch.testing.assert_close(fast[0], slow[0], rtol=0, atol=2e-5)
    torch.testing.assert_close(fast[1], slow[1], rtol=0, atol=2e-5)


@pytest.mark.parametrize("max_range_m", [25.0, 74.9])
def test_recovers_every_distance_of_the_range(max_range_m):
    truth = torch.linspace(0.01, max_range_m - 0.01, 5000, dtype=torch.float64)
    distance, residual = unwrap_dual(
        phase_of(truth, F1), phase_of(truth, F2), F1, F2, max_range_m=max_range_m
    )
    torch.testing.assert_close(distance.double(), truth, rtol=0, atol=1e-4)
    assert residual.max() < 1e-4


def test_wraps_are_right_while_the_frequencies_differ_by_less_than_half_the_lattice():
    truth = torch.linspace(1.0, 24.0, 2000, dtype=torch.float64)
    # Candidates within 25 m lie 2.5 m apart: 1.2 m is just below half of that.
    for shift in (-1.2, 1.2):
        distance, residual = unwrap_dual(
            phase_of(truth, F1), phase_of(truth + shift, F2), F1, F2, max_range_m=25.0
        )
        share2 = F2**2 / (F1**2 + F2**2)
        torch.testing.assert_close(distance.double(), truth + shift * share2, rtol=0, atol=1e-4)
        torch.testing.assert_close(residual, torch.full_like(residual, 1.2), rtol=0, atol=1e-4)


def test_fusion_has_the_smallest_variance():
    generator = torch.Generator().manual_seed(1)
    noise = 0.02 * torch.randn(2, 200_000, generator=generator)
    truth = torch.full((200_000,), 9.0, dtype=torch.float64)
    distance, _ = unwrap_dual(
        phase_of(truth, F1) + noise[0], phase_of(truth, F2) + noise[1], F1, F2, max_range_m=25.0
    )
    # Weights 1 / sigma^2 add up: 1 / sigma^2 = (f1^2 + f2^2) / (c noise / 4 pi)^2.
    metres_per_radian = 299_792_458.0 / (4 * math.pi)
    expected = 0.02 * metres_per_radian / math.hypot(F1, F2)
    assert float(distance.std()) == pytest.approx(expected, rel=0.01)


def test_inputs_are_not_written():
    phases = torch.rand(2, 8, 8)
    before = phases.clone()
    unwrap_dual(phases[0], phases[1], F1, F2, max_range_m=25.0)
    assert torch.equal(phases, before)


@pytest.mark.parametrize("wrong", [{"f1_hz": 0.0}, {"f2_hz": -1.0}, {"max_range_m": math.nan}])
def test_refuses_impossible_numbers(wrong):
    values = {"f1_hz": F1, "f2_hz": F2, "max_range_m": 25.0} | wrong
    with pytest.raises(ValueError, match=next(iter(wrong))):
        unwrap_dual(torch.zeros(2, 2), torch.zeros(2, 2), **values)


def test_refuses_unequal_shapes():
    with pytest.raises(ValueError, match="phase2_rad"):
        unwrap_dual(torch.zeros(2, 2), torch.zeros(2, 3), F1, F2, max_range_m=25.0)
