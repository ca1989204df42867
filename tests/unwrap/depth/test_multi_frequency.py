"""Unwrapping over one to three frequencies: slow references, closed forms, errors in noise."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch

from unwrap.depth.candidates import chosen
from unwrap.depth.kernel_density import KernelDensity, vote_frequencies
from unwrap.depth.mismatch import hypotheses, hypotheses_by_torch
from unwrap.depth.multi_frequency import unwrap_dual, unwrap_frequencies
from unwrap.signal.decoding import TWO_PI
from unwrap.signal.frames import PhaseFrame
from unwrap.signal.frequencies import joint_range_m, unambiguous_range_m

F1, F2 = 24e6, 10e6
KINECT_HZ = (120e6, 80e6, 16e6)
M_RAD_PER_S = 299_792_458.0 / (4 * math.pi)
"""Distance times frequency of a phase of one radian."""


def phase_of(distance, frequency):
    return (distance * frequency / M_RAD_PER_S % TWO_PI).float()


def phases_of(distance, frequencies, noise_rad=0.0, seed=0):
    """Phases [K, ...] in [0, 2 pi), with Gaussian noise."""
    exact = torch.stack([distance.double() * f / M_RAD_PER_S for f in frequencies])
    noise = torch.randn(exact.shape, generator=torch.Generator().manual_seed(seed))
    # The largest double below 2 pi is 2 pi as a float: there it is the phase 0.
    return ((exact + noise_rad * noise) % TWO_PI).float().remainder(TWO_PI)


def unwrap_slowly(phases, frequencies, max_range_m):
    """Every choice of wrap counts of one pixel at a time, in plain Python."""
    ranges = [unambiguous_range_m(f) for f in frequencies]
    total = sum(f**2 for f in frequencies)
    shape = phases[0].shape
    distance, residual = torch.empty(shape), torch.empty(shape)
    for index in range(distance.numel()):
        wrapped = [
            float(p.flatten()[index]) / TWO_PI * r for p, r in zip(phases, ranges, strict=True)
        ]
        best = math.inf
        for first in itertools.count():
            reach = wrapped[0] + first * ranges[0]
            if first and reach > max_range_m:
                break
            # One wrap beyond the candidate on both sides: no other one can be nearer.
            near = [
                [d + m * r for m in range(int((reach - d) // r) - 1, int((reach - d) // r) + 3)]
                for d, r in zip(wrapped[1:], ranges[1:], strict=True)
            ]
            for others in itertools.product(*near):
                places = (reach, *others)
                mean = sum(f**2 * d for f, d in zip(frequencies, places, strict=True)) / total
                cost = sum(f**2 * (d - mean) ** 2 for f, d in zip(frequencies, places, strict=True))
                if cost < best:
                    best, found = cost, (max(0.0, mean), max(places) - min(places))
        distance.view(-1)[index], residual.view(-1)[index] = found
    return distance, residual


@pytest.mark.parametrize(
    ("max_range_m", "frequencies"),
    [
        (5.0, (F1, F2)),
        (15.0, (F1, F2)),
        (25.0, (F1, F2)),
        (74.0, (F1, F2)),
        (25.0, (60e6, 25e6)),
        (37.0, (100e6, 31e6)),
    ],
)
def test_two_frequencies_equal_the_slow_reference_on_any_phases(max_range_m, frequencies):
    generator = torch.Generator().manual_seed(7)
    phases = TWO_PI * torch.rand(2, 16, 16, generator=generator)
    fast = unwrap_frequencies(phases, frequencies, max_range_m=max_range_m)
    slow = unwrap_slowly(phases, frequencies, max_range_m)
    torch.testing.assert_close(fast[0], slow[0], rtol=0, atol=2e-5)
    torch.testing.assert_close(fast[1], slow[1], rtol=0, atol=2e-5)
    dual = unwrap_dual(*phases, *frequencies, max_range_m=max_range_m)
    assert all(map(torch.equal, dual, fast))


@pytest.mark.parametrize("frequencies", [KINECT_HZ, (80e6, 16e6, 120e6), (100e6, 60e6, 25e6)])
@pytest.mark.parametrize("max_range_m", [1.0, 8.0, 18.0])
def test_three_frequencies_equal_the_slow_reference_in_noise(frequencies, max_range_m):
    generator = torch.Generator().manual_seed(7)
    truth = max_range_m * torch.rand(12, 12, generator=generator)
    # Strong noise: of the widest range, some pixels come out in a wrong wrap.
    phases = phases_of(truth, frequencies, noise_rad=0.5)
    fast = unwrap_frequencies(phases, frequencies, max_range_m=max_range_m)
    slow = unwrap_slowly(phases, frequencies, max_range_m)
    # The reference tries all wraps of all frequencies together. One frequency after the other they
    # come out otherwise only where noise is nearly half a turn.
    same = (fast[0] - slow[0]).abs() < 2e-5
    assert same.sum() >= same.numel() - 1
    torch.testing.assert_close(fast[1][same], slow[1][same], rtol=0, atol=2e-5)
    if max_range_m == 18.0:
        assert ((fast[0] - truth).abs() > 0.5).any()


SETS = [
    *((F1,), (60e6,), (F1, F2), (100e6, 20e6), (90e6, 15e6), (100e6, 15e6)),
    *(KINECT_HZ, (80e6, 16e6, 120e6), (60e6, 24e6, 10e6)),
]


@pytest.mark.parametrize("frequencies", SETS)
def test_exact_phases_give_back_every_distance_of_the_joint_range_and_no_other(frequencies):
    joint_m = joint_range_m(*frequencies)
    turns = [joint_m / unambiguous_range_m(f) for f in frequencies]
    assert turns == pytest.approx([round(t) for t in turns])
    random = torch.rand(3000, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    truth = 0.01 + (joint_m - 0.02) * random
    found, residual = unwrap_frequencies(
        phases_of(truth, frequencies), frequencies, max_range_m=joint_m
    )
    torch.testing.assert_close(found.double(), truth, rtol=0, atol=1e-4)
    assert residual.max() < 1e-4
    # All phases come again after the joint range: it must fail there, by that range.
    beyond, _ = unwrap_frequencies(
        phases_of(truth + joint_m, frequencies), frequencies, max_range_m=joint_m
    )
    torch.testing.assert_close(beyond.double(), truth, rtol=0, atol=1e-4)


@pytest.mark.parametrize("frequencies", SETS)
def test_the_vote_gives_back_every_distance_of_the_joint_range(frequencies):
    joint_m = joint_range_m(*frequencies)
    # Patches of the size of the window, so that neighbours agree.
    truth = (
        0.02 + 0.96 * torch.rand(1, 3, 3, generator=torch.Generator().manual_seed(2))
    ) * joint_m
    truth = truth.repeat_interleave(12, 1).repeat_interleave(12, 2)
    frames = [
        PhaseFrame(phase, torch.full_like(phase, 100.0), None)
        for phase in phases_of(truth, frequencies)
    ]
    # Not so far from each other that two patches' hypotheses meet.
    parameters = KernelDensity(systematic_m=0.02, kernel_m=0.05)
    found, confidence = vote_frequencies(
        frames, frequencies, 1.0, max_range_m=joint_m, parameters=parameters
    )
    torch.testing.assert_close(found, truth, rtol=0, atol=1e-3)
    assert confidence.max() <= 1 and confidence[0, 6, 6] > 0.9


def test_one_frequency_gives_the_wrapped_distance():
    truth = torch.linspace(0.01, 20.0, 999, dtype=torch.float64)
    found, residual = unwrap_frequencies([phase_of(truth, F1)], [F1], max_range_m=20.0)
    torch.testing.assert_close(found.double(), truth % unambiguous_range_m(F1), rtol=0, atol=1e-5)
    assert not residual.any()


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


def test_the_residual_of_three_is_the_largest_disagreement_of_two():
    truth = torch.linspace(1.0, 17.0, 500, dtype=torch.float64)
    shifts = (0.02, -0.03, 0.04)
    moved = [phase_of(truth + s, f) for s, f in zip(shifts, KINECT_HZ, strict=True)]
    distance, residual = unwrap_frequencies(moved, KINECT_HZ, max_range_m=18.0)
    weights = np.square(KINECT_HZ)
    mean = float(np.average(shifts, weights=weights))
    torch.testing.assert_close(distance.double(), truth + mean, rtol=0, atol=1e-5)
    torch.testing.assert_close(residual, torch.full_like(residual, 0.07), rtol=0, atol=1e-5)


@pytest.mark.parametrize("frequencies", [(F1,), (F1, F2), KINECT_HZ])
def test_fusion_has_the_smallest_variance(frequencies):
    truth = torch.full((200_000,), 3.0, dtype=torch.float64)
    phases = phases_of(truth, frequencies, noise_rad=0.02)
    distance, _ = unwrap_frequencies(phases, frequencies, max_range_m=18.0)
    # Weights 1 / sigma^2 add up: 1 / sigma^2 = (f1^2 + f2^2 + ...) / (c noise / 4 pi)^2.
    expected = 0.02 * M_RAD_PER_S / math.hypot(*frequencies)
    assert float(distance.std()) == pytest.approx(expected, rel=0.01)
    assert float(distance.mean()) == pytest.approx(3.0, abs=5 * expected / 200_000**0.5)


def wrong_wrap_bounds(frequencies, distance_m, max_range_m, noise_rad):
    """Least and most probability of a wrong wrap by the distances of the lattice of phases.

    Of equal noise the true point and another candidate are told apart by half of their distance
    across the line of true distances: Q(D / 2 sigma). The likeliest error is a lower, the sum over
    all an upper bound (union bound).
    """
    direction = np.array(frequencies) / math.hypot(*frequencies)
    singles = {}
    for wraps in itertools.product(*(range(-16, 17) for _ in frequencies)):
        step = TWO_PI * np.array(wraps)
        along_m = float(step @ direction) * M_RAD_PER_S / math.hypot(*frequencies)
        across = float(np.linalg.norm(step - (step @ direction) * direction))
        if across > 1e-9 and 0 < distance_m + along_m < max_range_m:
            singles[wraps] = 0.5 * math.erfc(across / (2 * noise_rad) / math.sqrt(2))
    return max(singles.values()), sum(singles.values())


@pytest.mark.parametrize(
    ("frequencies", "distance_m", "max_range_m", "noise_rad"),
    [
        ((F1, F2), 10.0, 25.0, 0.5),
        ((80e6, 16e6), 4.6, 9.0, 0.25),
        (KINECT_HZ, 9.1, 18.0, 0.42),
    ],
)
def test_wrong_wraps_in_noise_are_as_many_as_the_lattice_says(
    frequencies, distance_m, max_range_m, noise_rad
):
    # No candidate lies so near to an end of the range that noise decides whether it counts.
    truth = torch.full((100_000,), distance_m, dtype=torch.float64)
    phases = phases_of(truth, frequencies, noise_rad=noise_rad, seed=3)
    found, _ = unwrap_frequencies(phases, frequencies, max_range_m=max_range_m)
    # Six deviations of the fused distance are still less than half of the way to the next.
    spread = noise_rad * M_RAD_PER_S / math.hypot(*frequencies)
    wrong = float(((found - distance_m).abs() > 6 * spread).float().mean())
    least, most = wrong_wrap_bounds(frequencies, distance_m, max_range_m, noise_rad)
    scatter = 4 * math.sqrt(most / 100_000)
    assert 0.002 < least < most < 0.2
    assert least - scatter < wrong < most + scatter


def test_a_third_frequency_extends_the_range():
    """The Kinect's 80 and 16 MHz alone repeat at 9.4 m; 80 and 120 MHz at 3.7 m."""
    truth = torch.linspace(0.1, 18.0, 1500, dtype=torch.float64)
    found = {}
    for frequencies in (KINECT_HZ, (80e6, 16e6), (120e6, 80e6)):
        phases = phases_of(truth, frequencies, noise_rad=0.1)
        distance, _ = unwrap_frequencies(phases, frequencies, max_range_m=18.7)
        found[frequencies] = float(((distance - truth).abs() < 0.3).float().mean())
    assert found[KINECT_HZ] == 1.0
    assert found[80e6, 16e6] < 0.75 and found[120e6, 80e6] < 0.5


def frames_of(distance, frequencies, amplitude, noise_lsb):
    """Decoded frames [B, H, W] of four noisy samples: noise / (amplitude sqrt 2) of each phase."""
    phases = phases_of(
        distance, frequencies, noise_rad=noise_lsb / amplitude / math.sqrt(2), seed=5
    )
    return [PhaseFrame(phase, torch.full_like(phase, amplitude), None) for phase in phases]


def test_neighbours_vote_better_than_single_pixels_over_three_frequencies():
    distance = torch.full((1, 48, 64), 9.0)
    distance[:, 12:36, 16:32] = 4.0
    frames = frames_of(distance, KINECT_HZ, 2.2, 1.5)
    alone, _ = unwrap_frequencies([f.phase_rad for f in frames], KINECT_HZ, max_range_m=18.0)
    voted, confidence = vote_frequencies(frames, KINECT_HZ, 1.5, max_range_m=18.0)
    wrong, wrong_alone = ((d - distance).abs() > 0.4 for d in (voted, alone))
    assert wrong_alone.float().mean() > 0.05
    assert wrong.float().mean() < 0.2 * wrong_alone.float().mean()
    assert confidence[~wrong].mean() > confidence[wrong].mean()


@pytest.mark.parametrize("frequencies", [(60e6,), (100e6, 20e6), KINECT_HZ])
@pytest.mark.parametrize("systematic_m", [0.0, 0.1])
def test_compiled_hypotheses_are_those_of_torch(frequencies, systematic_m):
    generator = torch.Generator().manual_seed(3)
    shape = (2, 9, 11)
    frames = [
        PhaseFrame(
            *(scale * torch.rand(shape, generator=generator) for scale in (TWO_PI, 9.0)), None
        )
        for _ in frequencies
    ]
    noise = 0.5 + torch.rand(shape, generator=generator)
    model = KernelDensity(systematic_m=systematic_m).mismatch_model(frequencies, 12.0)
    depth_m, weight = hypotheses(frames, noise, model, 3)
    expected = hypotheses_by_torch(frames, noise, model, min(3, model.wraps))
    torch.testing.assert_close(depth_m, expected[0], rtol=0, atol=1e-4)
    torch.testing.assert_close(weight, expected[1], rtol=1e-3, atol=1e-6)


def test_a_hypothesis_weighs_by_its_chi_square():
    """Of equal amplitudes: squares about the fused distance, over each frequency's variance."""
    noise_rad = 0.1 / math.sqrt(2)
    truth = torch.rand(1, 8, 8, generator=torch.Generator().manual_seed(4)) * 18
    phases = phases_of(truth, KINECT_HZ, noise_rad=noise_rad)
    frames = [PhaseFrame(phase, torch.full_like(phase, 15.0), None) for phase in phases]
    parameters = KernelDensity(systematic_m=0.0)
    depth_m, weight = hypotheses(
        frames, 1.5, parameters.mismatch_model(KINECT_HZ, 18.7), parameters.hypotheses
    )
    squares = torch.zeros_like(depth_m)
    for phase, f in zip(phases, KINECT_HZ, strict=True):
        turns = (depth_m - phase.unsqueeze(1) * M_RAD_PER_S / f) / unambiguous_range_m(f)
        squares += ((turns - turns.round()) * TWO_PI / noise_rad).square()
    expected = (-0.5 * (squares / parameters.mismatch_scale)).exp()
    expected *= math.exp(-0.5 * 3 * noise_rad**2 / parameters.phase_scale_rad2)
    first = torch.zeros(1, 8, 8, dtype=torch.long)
    torch.testing.assert_close(chosen(weight, first), chosen(expected, first), rtol=2e-3, atol=1e-6)


def test_inputs_are_not_written():
    phases = torch.rand(3, 8, 8)
    before = phases.clone()
    for count in (1, 2, 3):
        unwrap_frequencies(phases[:count], KINECT_HZ[:count], max_range_m=25.0)
    assert torch.equal(phases, before)


@pytest.mark.parametrize("wrong", [{"f1_hz": 0.0}, {"f2_hz": -1.0}, {"max_range_m": math.nan}])
def test_refuses_impossible_numbers(wrong):
    values = {"f1_hz": F1, "f2_hz": F2, "max_range_m": 25.0} | wrong
    with pytest.raises(ValueError, match=next(iter(wrong))):
        unwrap_dual(torch.zeros(2, 2), torch.zeros(2, 2), **values)


def test_refuses_unequal_shapes_and_other_numbers_of_frequencies():
    with pytest.raises(ValueError, match="phase2_rad"):
        unwrap_dual(torch.zeros(2, 2), torch.zeros(2, 3), F1, F2, max_range_m=25.0)
    with pytest.raises(ValueError, match=r"4 phases and .* 4 frequencies; expected 1 to 3"):
        unwrap_frequencies(torch.zeros(4, 2, 2), (F1,) * 4, max_range_m=25.0)
    frames = [PhaseFrame(torch.zeros(1, 2, 2), torch.ones(1, 2, 2), None)] * 2
    with pytest.raises(ValueError, match=r"2 phases and .* 3 frequencies"):
        vote_frequencies(frames, KINECT_HZ, 1.0, max_range_m=25.0)
