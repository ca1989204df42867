"""The peers without a network: what they win over single pixels, and slow references."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import pytest
import torch
from peer_scenes import SENSOR, UNAMBIGUOUS_M, samples, steps, wraps_of

from unwrap.depth.amplitude import Smoothness, min_sum, unwrap_amplitude
from unwrap.depth.candidates import candidates_m
from unwrap.depth.correction import correct
from unwrap.depth.kernel_density import (
    KernelDensity,
    density_by_torch,
    kernel_density,
    unwrap_kernel_density,
)
from unwrap.depth.mismatch import hypotheses, hypotheses_by_torch
from unwrap.depth.multi_frequency import unwrap_dual
from unwrap.depth.reflectance import BRIGHTEST, ReflectancePrior, calibrate
from unwrap.signal.calibrated import decode_at
from unwrap.signal.decoding import decode
from unwrap.signal.frames import RawFrame
from unwrap.signal.sensed import Sensed, Truth

RADIANT_LSB = 3000.0


def right_share(found_m, true_m):
    return float(((found_m - true_m).abs() < UNAMBIGUOUS_M / 2).float().mean())


def painted(shape, seed=0):
    """Reflectances 0.1 to 0.8 of patches of 8 x 8 pixels."""
    generator = torch.Generator().manual_seed(seed)
    coarse = 0.1 + 0.7 * torch.rand(
        shape[0], -(-shape[1] // 8), -(-shape[2] // 8), generator=generator
    )
    fine = coarse.repeat_interleave(8, 1).repeat_interleave(8, 2)
    return fine[:, : shape[1], : shape[2]]


def lambertian(distance_m, shots, noise_lsb, seed=1):
    """Samples of painted surfaces seen head-on."""
    amplitude = RADIANT_LSB * painted(distance_m.shape) / distance_m.square()
    return samples(distance_m, amplitude, shots, noise_lsb, seed)


def known(distance_m):
    return Truth(distance_m, torch.ones_like(distance_m, dtype=torch.bool))


@pytest.mark.parametrize("amplitude", [2.0, 3.0, 4.0])
def test_neighbours_vote_better_than_single_pixels_unwrap(amplitude):
    distance_m = steps()
    raw = samples(distance_m, amplitude, 8, SENSOR.noise_lsb, seed=3)
    phases = [decode(raw.dcs_lsb[:, i : i + 4]).phase_rad for i in (0, 4)]
    alone, _ = unwrap_dual(*phases, SENSOR.f1_hz, SENSOR.f2_hz, max_range_m=SENSOR.max_range_m)
    # Weak signals, too, are to be judged by their confidence here.
    found = unwrap_kernel_density(raw, replace(SENSOR, min_snr=1.0))
    wrong, wrong_alone = (1 - right_share(d, distance_m) for d in (found.depth.distance_m, alone))
    assert wrong_alone > 0.03
    assert wrong < 0.2 * wrong_alone
    # What is trusted is right more often than what is not.
    right = (found.depth.distance_m - distance_m).abs() < UNAMBIGUOUS_M / 2
    trusted = found.depth.valid
    assert right[trusted].float().mean() > 0.99
    assert right[trusted].float().mean() > right[~trusted].float().mean()


def test_without_noise_the_vote_gives_what_two_frequencies_give_but_at_a_few_edges():
    distance_m = steps()
    raw = samples(distance_m, 500.0, 8)
    found = unwrap_kernel_density(raw, SENSOR)
    plain = correct(raw, None, SENSOR)
    torch.testing.assert_close(plain.distance_m, distance_m, atol=1e-3, rtol=0)
    # A wrong candidate of a pixel may happen to be where its many neighbours across an edge are.
    same = (found.depth.distance_m - distance_m).abs() < 1e-3
    assert same.float().mean() > 0.995
    assert found.confidence.min() >= 0 and found.confidence.max() <= 1
    assert found.depth.unambiguous_m == pytest.approx(UNAMBIGUOUS_M)


def slow_density(depth_m, weight, parameters):
    """One image [I, H, W], pixel by pixel."""
    count, height, width = depth_m.shape
    votes = torch.zeros_like(depth_m)
    reach = range(-parameters.radius, parameters.radius + 1)
    norm = sum(math.exp(-0.5 * (s / parameters.spread_px) ** 2) for s in reach) ** 2
    for i, y, x in itertools.product(range(count), range(height), range(width)):
        vote = total = 0.0
        for dy, dx, j in itertools.product(reach, reach, range(count)):
            if 0 <= y + dy < height and 0 <= x + dx < width:
                near = math.exp(-0.5 * (dy**2 + dx**2) / parameters.spread_px**2) / norm
                near *= float(weight[j, y + dy, x + dx])
                apart = float(depth_m[j, y + dy, x + dx] - depth_m[i, y, x])
                vote += near * math.exp(-0.5 * (apart / parameters.kernel_m) ** 2)
                total += near
        votes[i, y, x] = vote / max(total, parameters.least_weight)
    return votes


def test_kernel_density_is_that_of_a_slow_sum():
    generator = torch.Generator().manual_seed(0)
    depth_m = 2 * torch.rand(1, 2, 5, 7, generator=generator)
    weight = torch.rand(1, 2, 5, 7, generator=generator)
    for parameters in (KernelDensity(radius=2), KernelDensity(radius=1, kernel_m=0.2)):
        expected = slow_density(depth_m[0], weight[0], parameters)
        torch.testing.assert_close(kernel_density(depth_m, weight, parameters)[0], expected)


PARAMETERS = (
    KernelDensity(),
    KernelDensity(radius=1, kernel_m=0.2),
    KernelDensity(radius=0, hypotheses=1),
    KernelDensity(radius=6, spread_px=4.0, hypotheses=9, kernel_m=1.3),
)


@pytest.mark.parametrize("parameters", PARAMETERS)
@pytest.mark.parametrize("amplitude", [0.5, 3.0, 30.0])
def test_compiled_vote_is_that_of_torch(amplitude, parameters):
    """The same winner but where two densities tie within 1e-5 of each other."""
    noisy = samples(steps(), amplitude, 8, SENSOR.noise_lsb, seed=7)
    frames = [decode_at(i, noisy, SENSOR) for i in (0, 1)]
    model = parameters.mismatch_model((SENSOR.f1_hz, SENSOR.f2_hz), SENSOR.max_range_m)
    kept = min(parameters.hypotheses, 5)
    depth_m, weight = hypotheses(frames, 1.5, model, kept)
    expected = hypotheses_by_torch(frames, 1.5, model, kept)
    same = (depth_m - expected[0]).abs() < 1e-4
    assert same.float().mean() > 0.9999  # Costs may tie, too.
    torch.testing.assert_close(weight[same], expected[1][same], rtol=1e-3, atol=1e-6)
    found = kernel_density(depth_m, weight, parameters)
    reference = density_by_torch(depth_m, weight, parameters)
    torch.testing.assert_close(found, reference, rtol=0, atol=5e-6)
    winner = reference.gather(1, found.argmax(1, keepdim=True))[:, 0]
    best = reference.amax(1)
    assert (winner >= best * (1 - 1e-5)).float().mean() > 0.9999
    assert (found.argmax(1) == reference.argmax(1)).float().mean() > 0.9995


def test_votes_that_would_be_subnormal_are_left_out():
    # Their arithmetic takes some ten times as long, and no other vote is so small.
    depth_m, weight = torch.full((1, 1, 9, 9), 5.0), torch.full((1, 1, 9, 9), 1e-30)
    assert density_by_torch(depth_m, weight, KernelDensity()).amax() < 1e-28
    assert kernel_density(depth_m, weight, KernelDensity()).amax() == 0
    weight[0, 0, 4, 4] = 1.0
    found, expected = (
        f(depth_m, weight, KernelDensity()) for f in (kernel_density, density_by_torch)
    )
    torch.testing.assert_close(found, expected, rtol=1e-5, atol=1e-7)


def test_a_frame_s_vote_does_not_depend_on_its_batch():
    noisy = samples(steps(), 3.0, 8, SENSOR.noise_lsb, seed=7)
    both = unwrap_kernel_density(noisy, SENSOR)
    alone = unwrap_kernel_density(RawFrame(noisy.dcs_lsb[1:], noisy.saturated[1:]), SENSOR)
    assert torch.equal(both.confidence[1:], alone.confidence)
    assert torch.equal(both.depth.distance_m[1:], alone.depth.distance_m)


def test_parameters_of_the_vote_are_checked():
    with pytest.raises(ValueError, match="kernel_m is 0; expected at least"):
        KernelDensity(kernel_m=0)
    with pytest.raises(ValueError, match="hypotheses is 0; expected at least 1"):
        KernelDensity(hypotheses=0)


def test_saturated_and_dark_pixels_are_not_valid_but_have_a_distance():
    distance_m = steps()
    raw = samples(distance_m, 500.0, 8)
    raw.saturated[:, :10] = True
    raw.dcs_lsb[:, :, -10:] *= 1e-3
    two = RawFrame(raw.dcs_lsb[:, :2], raw.saturated)
    prior = ReflectancePrior(500.0, (1 / 96,) * 96, (0.25,) * 4)
    for found in (unwrap_kernel_density(raw, SENSOR), unwrap_amplitude(two, SENSOR, prior=prior)):
        assert not found.depth.valid[:, :10].any() and not found.depth.valid[:, -10:].any()
        assert found.depth.distance_m.isfinite().all()


@pytest.mark.parametrize("shots", [2, 4])
def test_amplitude_tells_wraps_and_smoothness_helps(shots):
    distance_m = steps()
    raw = lambertian(distance_m, shots, noise_lsb=0.5)
    sensed = Sensed(torch.zeros_like(distance_m), raw, noise_lsb=torch.full_like(distance_m, 0.5))
    prior = calibrate([(sensed, known(distance_m))], SENSOR)
    shares = [
        right_share(
            unwrap_amplitude(
                raw, SENSOR, prior=prior, noise_lsb=0.5, smoothness=one
            ).depth.distance_m,
            distance_m,
        )
        for one in (Smoothness(per_m=0.0), Smoothness())
    ]
    commonest = wraps_of(distance_m).flatten().bincount().max() / distance_m.numel()
    assert shares[0] > commonest + 0.1
    assert shares[1] > shares[0] + 0.01


def test_min_sum_is_exact_along_a_line():
    generator = torch.Generator().manual_seed(0)
    shape = (1, 3, 1, 6)
    cost, depth_m = (
        torch.rand(shape, generator=generator),
        9 * torch.rand(shape, generator=generator),
    )
    logarithm = torch.rand(1, 1, 6, generator=generator)
    smoothness = Smoothness(per_m=0.2, largest_m=4.0, edge=0.5, rounds=1)
    expected = torch.full((3, 6), math.inf)
    for labels in itertools.product(range(3), repeat=6):
        energy = sum(float(cost[0, n, 0, i]) for i, n in enumerate(labels))
        for i, (m, n) in enumerate(itertools.pairwise(labels)):
            apart = min(abs(float(depth_m[0, m, 0, i] - depth_m[0, n, 0, i + 1])), 4.0)
            alike = math.exp(-abs(float(logarithm[0, 0, i] - logarithm[0, 0, i + 1])) / 0.5)
            energy += 0.2 * apart * alike
        for i, n in enumerate(labels):
            expected[n, i] = min(float(expected[n, i]), energy)
    for turned in (False, True):
        swap = (lambda t: t.transpose(-1, -2)) if turned else (lambda t: t)
        found = swap(min_sum(swap(cost), swap(depth_m), swap(logarithm), smoothness))[0, :, 0]
        # Messages are known up to a constant per pixel.
        torch.testing.assert_close(found - found.amin(0), expected - expected.amin(0))


def test_calibration_finds_scale_reflectances_and_wraps_despite_mirrors():
    distance_m = steps(96, 128)
    raw = lambertian(distance_m, 4, noise_lsb=0.0)
    raw.dcs_lsb[:, :, :1, :64] *= 1000.0
    prior = calibrate([(Sensed(torch.zeros_like(distance_m), raw), known(distance_m))], SENSOR)
    brightest = painted(distance_m.shape).flatten().quantile(BRIGHTEST + 0.005)
    assert prior.amplitude_at_1m_lsb == pytest.approx(RADIANT_LSB * float(brightest), rel=0.03)
    shares = wraps_of(distance_m).flatten().bincount() / distance_m.numel()
    assert prior.wraps == pytest.approx(shares.tolist(), abs=1e-3)
    assert sum(prior.density) == pytest.approx(1.0)
    inside, outside = (
        prior.log_density(torch.tensor(share * prior.amplitude_at_1m_lsb)) for share in (0.5, 0.01)
    )
    assert inside > outside + 3


def test_calibration_leaves_out_what_says_nothing():
    distance_m = steps()
    raw, truth = lambertian(distance_m, 2, noise_lsb=0.0), known(distance_m)
    sensed = Sensed(torch.zeros_like(distance_m), raw)
    expected = calibrate([(sensed, truth)], replace(SENSOR, max_range_m=25.0))
    # The same with sky, saturated pixels and pixels of unknown truth beside it.
    beside = [torch.cat((part, part), -1) for part in (distance_m, raw.saturated, truth.known)]
    more_m, saturated, sure = beside
    more_m[..., 64:80], saturated[..., 80:96], sure[..., 96:] = 30.0, True, False
    samples_lsb = torch.cat((raw.dcs_lsb, raw.dcs_lsb), -1)
    found = calibrate(
        [(Sensed(torch.zeros_like(more_m), RawFrame(samples_lsb, saturated)), Truth(more_m, sure))],
        SENSOR,
    )
    assert found.amplitude_at_1m_lsb == expected.amplitude_at_1m_lsb
    assert found.density == expected.density


def test_offset_and_drift_that_are_known_change_nothing():
    distance_m = steps()
    offset_lsb = torch.linspace(-20, 20, 64).expand_as(distance_m)
    shift_m = torch.tensor([0.3, -0.2], dtype=torch.float64)
    prior = ReflectancePrior(RADIANT_LSB, (1 / 96,) * 96, (0.4, 0.3, 0.2, 0.1))
    for shots, unwrap in ((2, unwrap_amplitude), (8, unwrap_kernel_density)):
        own = {"prior": prior} if shots == 2 else {}
        plain = unwrap(samples(distance_m, 300.0, shots), SENSOR, **own)
        moved = samples(distance_m - shift_m.view(-1, 1, 1), 300.0, shots)
        shifted = RawFrame(moved.dcs_lsb + offset_lsb.unsqueeze(1), moved.saturated)
        found = unwrap(shifted, SENSOR, offset_lsb=offset_lsb, shift_m=shift_m, **own)
        same = (found.depth.distance_m - plain.depth.distance_m).abs() < 0.01
        assert same.float().mean() > 0.99


def test_candidates_are_all_distances_of_a_phase_within_the_range():
    phase = torch.tensor([[[0.0, math.pi]]])
    found = candidates_m(phase, SENSOR.f1_hz, 25.0)
    assert found.shape == (1, 5, 1, 2)
    expected = (torch.arange(5)[:, None] + torch.tensor([0.0, 0.5])) * UNAMBIGUOUS_M
    torch.testing.assert_close(found[0, :, 0], expected)


def test_what_cannot_be_unwrapped_is_refused():
    raw, prior = samples(steps(), 100.0, 4), ReflectancePrior(1.0, (1 / 96,) * 96, (1.0,))
    with pytest.raises(ValueError, match="raw has 4 samples; expected 8"):
        unwrap_kernel_density(raw, SENSOR)
    with pytest.raises(ValueError, match="raw has 8 samples; expected 2 or 4"):
        unwrap_amplitude(samples(steps(), 100.0, 8), SENSOR, prior=prior)
    nothing = Truth(steps(), torch.zeros_like(steps(), dtype=torch.bool))
    with pytest.raises(ValueError, match="no pixel of known distance"):
        calibrate([(Sensed(steps(), raw), nothing)], SENSOR)
    with pytest.raises(ValueError, match="amplitude_at_1m_lsb is 0"):
        ReflectancePrior(0.0, (1 / 96,) * 96, (1.0,))
    with pytest.raises(ValueError, match=r"density is .*; expected 96 or more"):
        ReflectancePrior(1.0, (1.0,), (1.0,))
