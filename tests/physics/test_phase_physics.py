"""Noise of the decoded phase against closed forms, by Monte Carlo with pinned seeds."""

import math

import pytest
import torch

from unwrap.signal.decoding import TWO_PI, decode, distance_m
from unwrap.signal.frequencies import SPEED_OF_LIGHT_M_S

SHAPE = (500, 800)
SIGNAL_E, CONTRAST, AMBIENT_E, READ_E = 40_000.0, 0.85, 60_000.0, 83.0
VARIANCE = SIGNAL_E + AMBIENT_E + 2 * READ_E**2


def noisy_samples(phase_rad, count, seed):
    """D_k = m S cos(phi - k pi / 2) with variance S + B + 2 sigma_r^2, in electrons."""
    generator = torch.Generator().manual_seed(seed)
    angles = phase_rad - torch.arange(count) * (math.pi / 2)
    mean = CONTRAST * SIGNAL_E * torch.cos(angles)
    noise = torch.randn(count, *SHAPE, generator=generator)
    return mean[:, None, None] + math.sqrt(VARIANCE) * noise


@pytest.mark.parametrize("phase_rad", [0.7, 2.0, 4.4])
@pytest.mark.parametrize(("count", "factor"), [(2, 1.0), (4, 0.5)])
def test_phase_noise(phase_rad, count, factor):
    """sqrt(V) / (m S) with two samples, sqrt(V / 2) / (m S) with four."""
    phase = decode(noisy_samples(phase_rad, count, seed=count)).phase_rad
    expected = math.sqrt(factor * VARIANCE) / (CONTRAST * SIGNAL_E)
    assert float(phase.std()) == pytest.approx(expected, rel=0.005)
    assert float(phase.mean()) == pytest.approx(phase_rad, abs=5 * expected / math.sqrt(4e5))


@pytest.mark.parametrize(("frequency", "metres_per_radian"), [(24e6, 0.994), (10e6, 2.386)])
def test_distance_noise_per_radian(frequency, metres_per_radian):
    """sigma_d = c / (4 pi f) sigma_phi."""
    one = float(distance_m(torch.tensor(1.0), frequency))
    assert one == pytest.approx(metres_per_radian, abs=5e-4)


@pytest.mark.parametrize("wall_m", [0.5, 3.0, 6.0])
def test_a_wall_gives_its_phase(wall_m):
    """phi = 4 pi f d / c."""
    phase = 4 * math.pi * 24e6 * wall_m / SPEED_OF_LIGHT_M_S
    assert phase < TWO_PI
    dcs = torch.cos(phase - torch.arange(4) * (math.pi / 2))[:, None, None]
    assert float(distance_m(decode(dcs).phase_rad, 24e6)) == pytest.approx(wall_m, rel=1e-6)


def test_triangle_correlation_wiggles_four_times_per_period():
    """Four samples of a square-wave correlation: at most 0.0711 rad, rms 0.0509 rad."""
    phase = torch.linspace(0, TWO_PI, 20_001, dtype=torch.float64)[:-1]
    angles = phase - torch.arange(4)[:, None] * (math.pi / 2)
    triangle = torch.asin(torch.cos(angles))
    decoded = decode(triangle[:, None, :]).phase_rad[0]
    error = torch.remainder(decoded - phase + math.pi, TWO_PI) - math.pi
    assert float(error.abs().max()) == pytest.approx(0.0711, abs=2e-4)
    assert float(error.square().mean().sqrt()) == pytest.approx(0.0509, abs=2e-4)
    strongest = torch.fft.rfft(error)[1:].abs().argmax() + 1
    assert int(strongest) == 4
