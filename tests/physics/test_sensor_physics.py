"""Noise and identities of the sensor: photon transfer, depth noise, 8 = 4 = 2, slow reference."""

from __future__ import annotations

import math

import pytest
import torch

from shotenv.config.reader import merged
from shotenv.sensor.acquisition import expose
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.noise import draw_noise
from shotenv.sensor.offsets import OffsetPattern
from unwrap.signal.decoding import decode, distance_m
from unwrap.signal.shots import Shots, demodulation_phase_rad, frequency_index

C_M_S = 299_792_458.0
POWER_W, INTEGRATION_S = 7.0, 6e-4
LIGHT_LEVELS = [10.0 ** (-2.2 + 0.25 * i) for i in range(10)]


def settings():
    one = torch.ones(1, dtype=torch.float64)
    return {"laser_power_w": POWER_W * one, "integration_s": INTEGRATION_S * one}


def scene(sensor, distance_m, active, ambient) -> Exposure:
    """One-bounce light of maps [H, W]."""
    frequencies = (sensor.f1_hz, sensor.f2_hz)
    correlation = [
        active
        * torch.cos(
            4 * math.pi * frequencies[frequency_index(k)] / C_M_S * distance_m
            - demodulation_phase_rad(k)
        )
        for k in range(8)
    ]
    return Exposure(torch.stack(correlation)[None], active[None], ambient[None], distance_m[None])


def electrons(sensor, exposure):
    rate = electrons_per_radiance_second(sensor) * INTEGRATION_S
    return (rate * POWER_W * exposure.active).mean(), (rate * exposure.ambient).mean()


@pytest.mark.parametrize("ambient", LIGHT_LEVELS)
def test_photon_transfer(sensor, ambient):
    """Mean and variance of a sample within 1 % at ten light levels, 4e6 samples each.

    A fine converter leaves rounding out: its variance of 1/12 LSB^2 is no light.
    """
    fine = merged(sensor, {"gain_lsb_per_e": 0.4, "adc_bits": 16, "full_well_e": 1e7})
    maps = torch.ones(256, 256)
    exposure = scene(fine, maps * 0.3, maps * 0.01, maps * ambient)
    samples_e = torch.cat([acquired_e(exposure, fine, frame) for frame in range(16)])
    assert samples_e.numel() >= 4e6
    signal_e, ambient_e = electrons(fine, exposure)
    phase = 4 * math.pi * fine.f1_hz / C_M_S * 0.3
    expected_e = fine.contrast * signal_e * math.cos(phase)
    # D0 - D2 doubles the mean.
    mean_e = float((samples_e[:, 0] - samples_e[:, 2]).mean()) / 2
    assert mean_e == pytest.approx(float(expected_e), rel=0.01)
    variance = float(signal_e + ambient_e + 2 * fine.read_noise_e**2)
    found = samples_e.transpose(0, 1).flatten(1).var(dim=1).mean()
    assert float(found) == pytest.approx(variance, rel=0.01)


def acquired_e(exposure, sensor, frame):
    """Samples float64 [1, 4, H, W] of one noisy frame, in electrons."""
    noise = draw_noise(11, frame, 4, *exposure.active.shape[1:])[None]
    raw = expose(exposure, sensor, shots=Shots.FOUR, noise=noise, offsets=None, **settings())
    return raw.dcs_lsb.double() / sensor.gain_lsb_per_e


@pytest.mark.parametrize(("shots", "share"), [(Shots.FOUR, 0.5), (Shots.TWO, 1.0)])
def test_depth_noise_follows_the_formula(sensor, shots, share):
    """sigma_d = c / (4 pi f) sqrt(V share) / (m S): share 1/2 with four samples, 1 with two."""
    fine = merged(sensor, {"gain_lsb_per_e": 0.1, "adc_bits": 16, "full_well_e": 1e7})
    maps = torch.ones(500, 500)
    exposure = scene(fine, maps * 4.0, maps * 0.05, maps * 0.5)
    noise = draw_noise(3, 0, int(shots), 500, 500)[None]
    raw = expose(exposure, fine, shots=shots, noise=noise, offsets=None, **settings())
    found = float(distance_m(decode(raw.dcs_lsb).phase_rad, fine.f1_hz).double().std())
    signal_e, ambient_e = electrons(fine, exposure)
    variance = signal_e + ambient_e + 2 * fine.read_noise_e**2
    phase_noise = math.sqrt(share * float(variance)) / float(fine.contrast * signal_e)
    assert found == pytest.approx(C_M_S / (4 * math.pi * fine.f1_hz) * phase_noise, rel=0.01)


def test_eight_equals_four_equals_two_on_a_static_noise_free_scene(sensor):
    fine = merged(sensor, {"gain_lsb_per_e": 0.15, "adc_bits": 16, "full_well_e": 1e9})
    distance = torch.linspace(0.5, 5.7, 64 * 48).reshape(48, 64)
    exposure = scene(fine, distance, 0.05 / distance**2, torch.full_like(distance, 0.2))
    found = {}
    for shots in Shots:
        raw = expose(exposure, fine, shots=shots, noise=None, offsets=None, **settings())
        first = decode(raw.dcs_lsb[:, :4])
        found[shots] = distance_m(first.phase_rad, fine.f1_hz)[0]
    second = decode(raw.dcs_lsb[:, 4:])
    for shots in Shots:
        # Rounding to words of at least 100 in amplitude moves the phase below 0.5 %.
        assert (found[shots] - distance).abs().max() < 0.006
    assert (distance_m(second.phase_rad, fine.f2_hz)[0] - distance).abs().max() < 0.015


def test_four_samples_cancel_the_offset_that_two_see(sensor):
    maps = torch.ones(8, 8)
    exposure = scene(sensor, maps * 3.0, maps * 0.1, maps * 0.5)
    pattern = OffsetPattern(torch.full((1, 8, 8), 20.0), torch.zeros(1, 8, 8))
    found = {}
    for shots in (Shots.TWO, Shots.FOUR):
        raw = expose(exposure, sensor, shots=shots, noise=None, offsets=pattern, **settings())
        found[shots] = distance_m(decode(raw.dcs_lsb).phase_rad, sensor.f1_hz)[0]
    amplitude_lsb = decode(raw.dcs_lsb).amplitude.mean()
    assert (found[Shots.FOUR] - 3.0).abs().max() < 0.01
    # A common offset o moves both quadratures: an error of about 0.994 m * o (cos - sin) / A.
    phase = 4 * math.pi * sensor.f1_hz * 3.0 / C_M_S
    expected_m = 0.994 * 20.0 * (math.cos(phase) - math.sin(phase)) / float(amplitude_lsb)
    error_m = float((found[Shots.TWO] - 3.0).mean())
    assert error_m == pytest.approx(expected_m, rel=0.15, abs=0.02)


def test_signal_falls_with_the_square_of_distance(sensor):
    fine = merged(sensor, {"gain_lsb_per_e": 0.5, "adc_bits": 16, "full_well_e": 1e9})
    amplitudes = []
    for metres in (2.0, 4.0):
        maps = torch.ones(4, 4)
        exposure = scene(fine, maps * metres, maps * 0.2 / metres**2, maps * 0.0)
        raw = expose(exposure, fine, shots=Shots.FOUR, noise=None, offsets=None, **settings())
        amplitudes.append(float(decode(raw.dcs_lsb).amplitude.mean()))
    assert amplitudes[0] / amplitudes[1] == pytest.approx(4.0, rel=1e-3)


def slow_reference(exposure, sensor, noise, pattern, y, x):
    """Samples and flag of one pixel, written down from the formulas one number at a time."""
    rate = electrons_per_radiance_second(sensor) * INTEGRATION_S
    signal = float(exposure.active[0, y, x]) * rate * POWER_W
    ambient = float(exposure.ambient[0, y, x]) * rate
    samples, saturated = [], False
    for k in range(noise.shape[1]):
        modulated = float(exposure.correlation[0, k, y, x]) * rate * POWER_W * sensor.contrast
        taps = []
        for tap, sign in enumerate((1, -1)):
            charge = max((signal + ambient) / 2 + sign * modulated / 2, 0.0)
            normal = float(noise[0, k, tap, y, x])
            sigma = math.sqrt(charge + sensor.read_noise_e**2)
            saturated |= charge + sigma * normal >= sensor.full_well_e
            taps.append(read_tap(charge, sensor, normal))
        parity = 1 if y % 2 == 0 else -1
        rises = sensor.offset_ambient_lsb * min(ambient / 2 / sensor.full_well_e, 1.0)
        offset = float(pattern.pattern_lsb[0, y, x]) + parity * rises
        word = round((taps[0] - taps[1]) * sensor.gain_lsb_per_e + offset)
        samples.append(min(max(word, -2048), 2047))
        saturated |= not -2047 <= word <= 2046
    return samples, saturated


def read_tap(charge, sensor, normal):
    """A charge cut off by the full well, and read; mean and variance by integration."""
    read = sensor.read_noise_e**2
    if abs(charge - sensor.full_well_e) > 6 * math.sqrt(charge):
        held = min(charge, sensor.full_well_e)
        return held + normal * math.sqrt((charge if held == charge else 0.0) + read)
    steps = torch.linspace(-9, 9, 20_001, dtype=torch.float64)
    weight = torch.exp(-steps.square() / 2)
    weight /= weight.sum()
    cut = (charge + math.sqrt(charge) * steps).clamp(max=sensor.full_well_e)
    mean = float((weight * cut).sum())
    variance = float((weight * (cut - mean).square()).sum())
    return mean + normal * math.sqrt(variance + read)


def test_a_slow_loop_over_pixels_gives_the_same_words(sensor):
    generator = torch.Generator().manual_seed(1)
    distance = 1.0 + 12.0 * torch.rand(16, 16, generator=generator)
    # From darkness to full taps, near and far.
    ambient = 10.0 ** (4.0 * torch.rand(16, 16, generator=generator) - 3.0)
    exposure = scene(sensor, distance, 0.6 / distance**2, ambient)
    noise = draw_noise(9, 9, 8, 16, 16)[None]
    pattern = OffsetPattern(
        20 * torch.randn(1, 16, 16, generator=generator), torch.zeros(1, 16, 16)
    )
    raw = expose(exposure, sensor, shots=Shots.EIGHT, noise=noise, offsets=pattern, **settings())
    assert raw.saturated.any() and not raw.saturated.all()
    different = 0
    for y in range(16):
        for x in range(16):
            samples, saturated = slow_reference(exposure, sensor, noise, pattern, y, x)
            apart = (raw.dcs_lsb[0, :, y, x] - torch.tensor(samples)).abs()
            # float32 against float64 may round a value next to one half the other way.
            assert apart.max() <= 1
            different += int((apart > 0).sum())
            assert bool(raw.saturated[0, y, x]) == saturated
    assert different <= 4
