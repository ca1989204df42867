"""Effects of the imager against closed forms: photon transfer, offset, temperature, gray blur."""

from __future__ import annotations

import math

import pytest
import torch
from acquisitions import INTEGRATION_S, POWER_W, acquired

from shotenv.config.reader import merged
from shotenv.sensor.drift import distance_drift_m, imager_temperature_k, residual_drift_m
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.gray import capture_gray
from shotenv.sensor.noise import Purpose, draw_noise, stream
from shotenv.sensor.offsets import OffsetPattern, draw_offsets
from unwrap.signal.shots import demodulation_phase_rad

LIGHT_LEVELS = [10.0 ** (-3.0 + 0.25 * i) for i in range(10)]


def at_phase_zero(radiance, shape, *, ambient=0.0) -> Exposure:
    """A wall whose phase is 0: all of the signal is in D0 and D2."""
    active = torch.full((1, *shape), radiance)
    samples = [active * math.cos(demodulation_phase_rad(k)) for k in range(8)]
    everywhere = torch.ones_like(active)
    return Exposure(torch.stack(samples, 1), active, ambient * everywhere, everywhere)


def test_the_photon_transfer_line_gives_gain_and_read_noise(sensor):
    """Variance over mean of laser light: Var(D) = g mean(D) / m + 2 g^2 sigma_r^2.

    Ten levels over more than two decades, 4e6 samples in all.
    """
    fine = merged(sensor, {"gain_lsb_per_e": 0.1, "adc_bits": 16, "full_well_e": 1e7})
    gain, shape = fine.gain_lsb_per_e, (320, 320)
    means, variances = [], []
    for level, radiance in enumerate(LIGHT_LEVELS):
        noise = draw_noise(21, level, 4, *shape)[None]
        dcs = acquired(at_phase_zero(radiance, shape), fine, noise=noise).dcs_lsb.double()
        means.append((dcs[:, 0] - dcs[:, 2]).mean() / 2)
        variances.append(dcs.var(dim=(2, 3)).mean())
        expected = gain * means[-1] / fine.contrast + 2 * (gain * fine.read_noise_e) ** 2
        assert float(variances[-1]) == pytest.approx(float(expected), rel=0.01)
    mean, variance = torch.stack(means), torch.stack(variances)
    # Weighted by 1 / variance, since the variance's own error is proportional to it.
    design = torch.stack((mean, torch.ones_like(mean)), dim=1) / variance[:, None]
    ones = torch.ones_like(mean)[:, None]
    slope, intercept = torch.linalg.lstsq(design, ones).solution.flatten().tolist()
    assert slope * fine.contrast == pytest.approx(gain, rel=0.01)
    assert intercept == pytest.approx(2 * (gain * fine.read_noise_e) ** 2, rel=0.01)


def test_estimates_of_the_offset_from_opposite_samples_agree_but_for_noise(sensor):
    """(D0 + D2) / 2 and (D1 + D3) / 2 both see the pattern; their correlation has a closed form."""
    shape, radiance = (300, 400), 0.002
    offsets = draw_offsets(sensor, *shape, generator=stream(Purpose.OFFSETS, 5))
    noise = draw_noise(4, 0, 4, *shape)[None]
    exposure = at_phase_zero(radiance, shape)
    dcs = acquired(exposure, sensor, noise=noise, offsets=offsets).dcs_lsb[0].double()
    even, odd = (dcs[0] + dcs[2]) / 2, (dcs[1] + dcs[3]) / 2
    signal_e = electrons_per_radiance_second(sensor) * radiance * POWER_W * INTEGRATION_S
    gain2 = sensor.gain_lsb_per_e**2
    # Half of one sample's variance, and of the rounding's.
    noise_variance = (gain2 * (signal_e + 2 * sensor.read_noise_e**2) + 1 / 12) / 2
    pattern_variance = float(offsets.pattern_lsb.double().var())
    expected = pattern_variance / (pattern_variance + noise_variance)
    found = float(torch.corrcoef(torch.stack((even.flatten(), odd.flatten())))[0, 1])
    assert 1 - found == pytest.approx(1 - expected, rel=0.03)
    assert found > 0.99
    assert float((even - offsets.pattern_lsb[0]).abs().mean()) < 2 * math.sqrt(noise_variance)


def test_offset_drifts_with_temperature_by_a_pattern_that_no_map_knows(sensor):
    drifting = merged(sensor, {"offset_drift_lsb_per_k": 0.1, "calibration_temperature_k": 300.0})

    def drawn(config, imager_k):
        generator = stream(Purpose.OFFSETS, 7)
        return draw_offsets(config, 300, 400, generator=generator, imager_k=imager_k)

    still, cold, warm = drawn(sensor, None), drawn(drifting, 300.0), drawn(drifting, 320.0)
    assert torch.equal(cold.pattern_lsb, still.pattern_lsb)
    for pattern in (cold, warm):
        assert torch.equal(pattern.calibrated_lsb, still.calibrated_lsb)
    drift = warm.pattern_lsb - cold.pattern_lsb
    assert float(drift.std()) == pytest.approx(2.0, rel=0.01)
    assert float(drift.mean(dim=-1).std()) == pytest.approx(2.0 / math.sqrt(400), rel=0.15)
    together = torch.stack((drift.flatten(), cold.pattern_lsb.flatten()))
    assert abs(float(torch.corrcoef(together)[0, 1])) < 0.01
    halfway = drawn(drifting, 290.0).pattern_lsb - cold.pattern_lsb
    assert (halfway + 0.5 * drift).abs().max() < 1e-4


def test_a_stored_map_leaves_its_share_of_the_pattern(sensor):
    offsets = draw_offsets(sensor, 200, 300, generator=stream(Purpose.OFFSETS, 8))
    left = (offsets.pattern_lsb - offsets.calibrated_lsb).std() / offsets.pattern_lsb.std()
    assert float(left) == pytest.approx(1 - sensor.offset_calibrated_share, rel=1e-4)


def test_ambient_offset_alternates_between_rows_and_is_linear(sensor):
    flat = OffsetPattern(torch.zeros(1, 6, 8), torch.zeros(1, 6, 8))
    fine = merged(sensor, {"offset_ambient_lsb": 4000.0, "adc_bits": 16})
    found = []
    for ambient in (0.25, 0.5):
        exposure = at_phase_zero(0.0, (6, 8), ambient=ambient)
        dcs = acquired(exposure, fine, offsets=flat).dcs_lsb
        assert torch.equal(dcs[:, :, 0::2], -dcs[:, :, 1::2])
        found.append(float(dcs[0, 0, 0, 0]))
    assert found[1] == pytest.approx(2 * found[0], abs=1.0) and found[0] > 100


@pytest.mark.parametrize(("per_kelvin_m", "share"), [(12.5e-3, 0.0), (15.6e-3, 0.9), (0.0, 0.5)])
def test_distance_drifts_per_kelvin_and_is_compensated_in_part(sensor, per_kelvin_m, share):
    drifting = merged(
        sensor,
        {
            "distance_drift_m_per_k": per_kelvin_m,
            "drift_compensated_share": share,
            "calibration_temperature_k": 298.15,
            "self_heating_k": 8.0,
        },
    )
    imager_k = imager_temperature_k(drifting, torch.tensor([290.15, 310.15], dtype=torch.float64))
    assert imager_k.tolist() == pytest.approx([298.15, 318.15])
    drift_m = distance_drift_m(drifting, imager_k)
    assert drift_m.tolist() == pytest.approx([0.0, 20 * per_kelvin_m], abs=1e-12)
    left_m = residual_drift_m(drifting, imager_k)
    assert left_m.tolist() == pytest.approx(((1 - share) * drift_m).tolist())


def test_gray_noise_follows_photon_transfer(sensor):
    """Variance of gray: g^2 (B + sigma_r^2), one tap, plus rounding; 12 bits."""
    ambient = torch.full((1, 400, 500), 0.3)
    noise = torch.randn(ambient.shape, generator=torch.Generator().manual_seed(3))
    gray, exposure_s = capture_gray(ambient, sensor, noise=noise)
    charge_e = electrons_per_radiance_second(sensor) * 0.3 * float(exposure_s)
    gain = 4095 / sensor.full_well_e
    assert float(gray.double().mean()) == pytest.approx(gain * charge_e, rel=1e-3)
    expected = gain**2 * (charge_e + sensor.read_noise_e**2) + 1 / 12
    assert float(gray.double().var()) == pytest.approx(expected, rel=0.01)
    assert gray.min() >= 0 and gray.max() <= 4095
