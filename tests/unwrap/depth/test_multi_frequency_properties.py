"""Unwrapping over two and three frequencies: every distance of the range, exact and in noise."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from unwrap.depth.kernel_density import KernelDensity, vote_frequencies
from unwrap.depth.multi_frequency import fusing_shares, unwrap_dual, unwrap_frequencies
from unwrap.signal.decoding import TWO_PI
from unwrap.signal.frames import PhaseFrame
from unwrap.signal.frequencies import candidate_spacing_m, joint_range_m, unambiguous_range_m

MHZ = 1e6
PIXELS = 12
EDGE_M = 2e-3
"""From the ends of a range, where a last bit decides on which side of them a phase lies."""
places = arrays(np.float64, PIXELS, elements=st.floats(0.0, 1.0))
signs = arrays(np.float64, PIXELS, elements=st.floats(-1.0, 1.0))


def phases_of(distance_m: np.ndarray, frequency_hz: float) -> torch.Tensor:
    """phi = 4 pi f d / c, wrapped into [0, 2 pi)."""
    turns = distance_m / unambiguous_range_m(frequency_hz) % 1.0
    # The largest double below 2 pi is 2 pi as a float: there it is the phase 0.
    return torch.from_numpy(turns * TWO_PI).float().remainder(TWO_PI)


@st.composite
def pairs_of_frequencies(draw):
    """f1 > f2 in whole MHz, and a range over which their candidates are well apart."""
    f2 = draw(st.integers(3, 60))
    f1 = draw(st.integers(f2 + 1, 120))
    farthest_m = min(joint_range_m(f1 * MHZ, f2 * MHZ), 100.0)
    range_m = farthest_m * draw(st.floats(0.2, 1.0))
    assume(candidate_spacing_m(f1 * MHZ, f2 * MHZ, range_m) > 0.05)
    return f1 * MHZ, f2 * MHZ, range_m


@given(pairs_of_frequencies(), places)
def test_every_distance_within_the_range_comes_back(case, place):
    f1, f2, range_m = case
    truth = EDGE_M + place * (range_m - 2 * EDGE_M)
    found, residual = unwrap_dual(
        phases_of(truth, f1), phases_of(truth, f2), f1, f2, max_range_m=range_m
    )
    np.testing.assert_allclose(found.numpy(), truth, rtol=0, atol=1e-4)
    assert float(residual.max()) < 1e-4


@given(pairs_of_frequencies(), places, signs, signs)
def test_wraps_are_right_within_half_the_spacing_of_candidates(case, place, first, second):
    f1, f2, range_m = case
    share2 = f2**2 / (f1**2 + f2**2)
    allowed_m = 0.49 * candidate_spacing_m(f1, f2, range_m)
    # Each errs by up to half of what both may disagree by; f1 stays inside of the range.
    error1, error2 = first * allowed_m / 2, second * allowed_m / 2
    assume(range_m > 2 * (EDGE_M + allowed_m))
    truth = EDGE_M + allowed_m / 2 + place * (range_m - 2 * EDGE_M - allowed_m)
    found, residual = unwrap_dual(
        phases_of(truth + error1, f1), phases_of(truth + error2, f2), f1, f2, max_range_m=range_m
    )
    fused = truth + (1 - share2) * error1 + share2 * error2
    np.testing.assert_allclose(found.numpy(), fused.clip(min=0), rtol=0, atol=2e-4)
    np.testing.assert_allclose(residual.numpy(), np.abs(error1 - error2), rtol=0, atol=2e-4)


@st.composite
def threes_of_frequencies(draw):
    """Three frequencies in whole steps of 4 MHz, the highest first, and the range of all three."""
    numbers = draw(st.lists(st.integers(1, 30), min_size=3, max_size=3, unique=True))
    frequencies = tuple(4 * MHZ * n for n in sorted(numbers, reverse=True))
    return frequencies, joint_range_m(*frequencies)


@given(threes_of_frequencies(), places)
def test_three_frequencies_bring_every_distance_back(case, place):
    frequencies, range_m = case
    truth = EDGE_M + place * (range_m - 2 * EDGE_M)
    phases = [phases_of(truth, f) for f in frequencies]
    found, residual = unwrap_frequencies(phases, frequencies, max_range_m=range_m)
    np.testing.assert_allclose(found.numpy(), truth, rtol=0, atol=1e-4)
    assert float(residual.max()) < 2e-4


@given(pairs_of_frequencies(), places, st.floats(0.0, 1.0))
def test_a_longer_range_finds_the_same_distances(case, place, more):
    f1, f2, range_m = case
    truth = EDGE_M + place * (range_m - 2 * EDGE_M)
    longer_m = range_m + more * (min(joint_range_m(f1, f2), 100.0) - range_m)
    assume(candidate_spacing_m(f1, f2, longer_m) > 0.05)
    phases = phases_of(truth, f1), phases_of(truth, f2)
    found = [unwrap_dual(*phases, f1, f2, max_range_m=end)[0] for end in (range_m, longer_m)]
    torch.testing.assert_close(*found, rtol=0, atol=1e-5)


@given(
    pairs_of_frequencies(), arrays(np.float32, (2, PIXELS), elements=st.floats(0, 6.25, width=32))
)
def test_of_any_phases_the_best_candidate_wins(case, phases):
    """Whatever the phases: no other wrap within the range lets the frequencies agree better."""
    f1, f2, range_m = case
    range1_m, range2_m = unambiguous_range_m(f1), unambiguous_range_m(f2)
    found, residual = unwrap_dual(*torch.from_numpy(phases), f1, f2, max_range_m=range_m)
    wrapped1, wrapped2 = (phases[k] / TWO_PI * r for k, r in enumerate((range1_m, range2_m)))
    best = np.full(PIXELS, np.inf)
    for n in range(math.floor(range_m / range1_m) + 1):
        turned = (wrapped1 + n * range1_m - wrapped2) / range2_m
        off = np.abs(turned - np.round(turned)) * range2_m
        # At the end of the range a last bit decides.
        inside = (wrapped1 + n * range1_m < range_m - EDGE_M) | (n == 0)
        best = np.where(inside, np.minimum(best, off), best)
    assert np.all(residual.numpy() <= best + 2e-4)
    assert bool((found >= 0).all())


@given(st.integers(1, 120), st.integers(1, 120), st.floats(0.5, 200.0))
def test_the_spacing_is_the_least_of_any_two_candidates(f1, f2, range_m):
    assume(f1 != f2)
    range1_m, range2_m = unambiguous_range_m(f1 * MHZ), unambiguous_range_m(f2 * MHZ)
    at_f2 = [n * range1_m for n in range(math.floor(range_m / range1_m) + 1)]
    apart = [
        abs((b - a) / range2_m - round((b - a) / range2_m)) * range2_m
        for a, b in itertools.combinations(at_f2, 2)
    ]
    spacing = candidate_spacing_m(f1 * MHZ, f2 * MHZ, range_m)
    # A single candidate has itself for a neighbour, a whole range of f2 away.
    assert spacing == pytest.approx(min(apart, default=range2_m), abs=1e-6)


@given(st.lists(st.integers(1, 200_000), min_size=1, max_size=3))
def test_all_phases_repeat_after_the_joint_range_and_no_earlier(kilohertz):
    joint_m = joint_range_m(*(1e3 * f for f in kilohertz))
    periods = [joint_m / unambiguous_range_m(1e3 * f) for f in kilohertz]
    assert periods == pytest.approx([round(p) for p in periods], rel=1e-9)
    assert math.gcd(*(round(p) for p in periods)) == 1


@given(st.lists(st.floats(1e6, 2e8), min_size=1, max_size=3))
def test_shares_fuse_to_weights_by_inverse_variance(frequencies):
    weights = np.zeros(len(frequencies))
    for number, share in enumerate(fusing_shares(frequencies)):
        weights *= 1 - share
        weights[number] = share
    squares = np.square(frequencies)
    np.testing.assert_allclose(weights, squares / squares.sum(), rtol=1e-9)


@settings(max_examples=settings().max_examples // 12)  # each works tables out, for half a second
@given(pairs_of_frequencies(), st.floats(0.0, 1.0), st.floats(5.0, 500.0))
def test_neighbours_that_see_one_surface_find_its_distance(case, place, amplitude):
    f1, f2, range_m = case
    truth = np.full((1, 5, 6), EDGE_M + place * (range_m - 2 * EDGE_M))
    strength = torch.full(truth.shape, amplitude)
    frames = [PhaseFrame(phases_of(truth, f), strength, None) for f in (f1, f2)]
    parameters = KernelDensity(systematic_m=0.0)
    found, confidence = vote_frequencies(
        frames, (f1, f2), 1.0, max_range_m=range_m, parameters=parameters
    )
    assert bool((confidence >= 0).all() and (confidence <= 1 + 1e-5).all())
    np.testing.assert_allclose(found.numpy(), truth, rtol=0, atol=1e-3)
