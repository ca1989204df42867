"""Sensor: closed forms without noise, effects switched off by zero, bad input refused."""

from __future__ import annotations

import math

import pytest
import torch

from shotenv.config.reader import merged
from shotenv.sensor.acquisition import expose, incident_light, scored_pixels, sensitivity
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.gray import capture_gray, sample_noise_lsb
from shotenv.sensor.noise import Purpose, draw_noise, stream, stream_seed
from shotenv.sensor.offsets import OffsetPattern, draw_offsets
from shotenv.sensor.pixel_loops import word_lsb
from unwrap.signal.shots import Shots, demodulation_phase_rad, frequency_index

C_M_S = 299_792_458.0
QUIET = {"read_noise_e": 0.0, "offset_std_lsb": 0.0, "offset_ambient_lsb": 0.0}


def wall(sensor, distance_m, *, radiance=0.02, ambient=0.1, shape=(4, 5)) -> Exposure:
    """Light of a wall at one distance, batch of one; one bounce."""
    frequencies = (sensor.f1_hz, sensor.f2_hz)
    active = torch.full((1, *shape), radiance)
    samples = [
        active
        * math.cos(
            4 * math.pi * frequencies[frequency_index(k)] * distance_m / C_M_S
            - demodulation_phase_rad(k)
        )
        for k in range(8)
    ]
    everywhere = torch.ones_like(active)
    return Exposure(torch.stack(samples, 1), active, ambient * everywhere, distance_m * everywhere)


def settings(power_w=7.0, integration_s=6e-4, batch=1):
    return {
        "laser_power_w": torch.full((batch,), power_w, dtype=torch.float64),
        "integration_s": torch.full((batch,), integration_s, dtype=torch.float64),
    }


def noise_free(exposure, sensor, shots=Shots.EIGHT, offsets=None, **kwargs):
    return expose(exposure, sensor, shots=shots, noise=None, offsets=offsets, **settings(**kwargs))


def test_electrons_follow_the_camera_equation(sensor):
    photon_j = 6.62607015e-34 * C_M_S / (sensor.wavelength_nm * 1e-9)
    irradiance = math.pi * 0.8 / (4 * 1.2**2)
    expected = irradiance * (20e-6) ** 2 * 0.28 / photon_j
    assert electrons_per_radiance_second(sensor) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("distance_m", [0.5, 3.0, 6.0, 11.0])
def test_samples_are_gain_times_contrast_times_signal_times_cosine(sensor, distance_m):
    signal_e = electrons_per_radiance_second(sensor) * 0.02 * 7.0 * 6e-4
    raw = noise_free(wall(sensor, distance_m), sensor)
    for k in range(8):
        frequency_hz = (sensor.f1_hz, sensor.f2_hz)[frequency_index(k)]
        phase = 4 * math.pi * frequency_hz * distance_m / C_M_S - (k % 4) * math.pi / 2
        expected = sensor.gain_lsb_per_e * sensor.contrast * signal_e * math.cos(phase)
        # The converter rounds to whole words.
        assert (raw.dcs_lsb[0, k] - expected).abs().max() <= 0.5 + 1e-3
    assert not raw.saturated.any()


def test_fewer_shots_are_a_prefix_with_and_without_noise(sensor):
    offsets = draw_offsets(sensor, 4, 5, generator=stream(Purpose.OFFSETS, 0))
    noise = draw_noise(1, 2, 8, 4, 5)[None]
    for normals in (None, noise):
        raw = {
            shots: expose(
                wall(sensor, 4.0), sensor, shots=shots, noise=normals, offsets=offsets, **settings()
            )
            for shots in Shots
        }
        for shots in Shots:
            assert raw[shots].shots == shots
            assert torch.equal(raw[shots].dcs_lsb, raw[Shots.EIGHT].dcs_lsb[:, :shots])


def test_one_sensor_serves_a_batch_of_frames(sensor):
    offsets = draw_offsets(sensor, 4, 5, generator=stream(Purpose.OFFSETS, 0))
    one = wall(sensor, 4.0)
    fields = (one.correlation, one.active, one.ambient, one.distance_m)
    three = Exposure(*(torch.cat([value] * 3) for value in fields))
    alone = noise_free(one, sensor, offsets=offsets).dcs_lsb
    together = noise_free(three, sensor, offsets=offsets, batch=3).dcs_lsb
    assert torch.equal(together, torch.cat([alone] * 3))
    two = OffsetPattern(*(torch.cat([offsets.pattern_lsb] * 2) for _ in range(2)))
    with pytest.raises(ValueError, match=r"pattern_lsb is \(2, 4, 5\); expected \(3, 4, 5\)"):
        noise_free(three, sensor, offsets=two, batch=3)
    with pytest.raises(RuntimeError, match="expand"):
        capture_gray(three.ambient, sensor, noise=torch.zeros_like(three.ambient[:2]))
    per_light = sensitivity(sensor, torch.full((3,), 7.0), torch.full((3,), 6e-4))
    light = incident_light(three, per_light)
    with pytest.raises(ValueError, match=r"truth_m is \(1, "):
        scored_pixels(light, one.distance_m, sensor)
    gray, exposure_s = capture_gray(three.ambient, sensor, noise=None)
    noise_lsb = sample_noise_lsb(gray, exposure_s[:1], torch.tensor([6e-4]), sensor)
    assert torch.equal(noise_lsb, noise_lsb[:1].expand(3, -1, -1))


def test_noise_of_fewer_shots_is_a_prefix_and_streams_differ():
    assert torch.equal(draw_noise(5, 6, 2, 3, 4), draw_noise(5, 6, 8, 3, 4)[:2])
    assert not torch.equal(draw_noise(5, 6, 2, 3, 4), draw_noise(5, 7, 2, 3, 4))
    assert not torch.equal(draw_noise(5, 6, 2, 3, 4), draw_noise(6, 5, 2, 3, 4))
    seeds = {stream_seed(p, a, b) for p in Purpose for a in range(50) for b in range(50)}
    assert len(seeds) == len(Purpose) * 2500


def test_full_well_clips_each_tap_before_the_difference(sensor):
    small = merged(sensor, {"full_well_e": 1000.0, **QUIET})
    # 24 MHz at distance 0: D0 holds (S + B) / 2 + m S / 2 in tap A.
    exposure = wall(sensor, 0.0, radiance=0.002, ambient=0.0)
    signal_e = electrons_per_radiance_second(sensor) * 0.002 * 7.0 * 6e-4
    low_tap_e = signal_e / 2 * (1 - sensor.contrast)
    assert signal_e / 2 * (1 + sensor.contrast) > 1000.0 > low_tap_e
    raw = noise_free(exposure, small)
    expected = sensor.gain_lsb_per_e * (1000.0 - low_tap_e)
    assert (raw.dcs_lsb[0, 0] - expected).abs().max() <= 0.5
    assert raw.saturated.all()


def test_converter_rounds_and_clips(sensor):
    loud = merged(sensor, {"gain_lsb_per_e": 10.0, "full_well_e": 1e9, **QUIET})
    raw = noise_free(wall(sensor, 0.0, radiance=0.01), loud)
    assert raw.dcs_lsb.min() == -2048 and raw.dcs_lsb.max() == 2047
    assert raw.saturated.all()
    analogue = (0.5, 1.5, -0.5, 7.2)
    assert [word_lsb(value, -2.0, 5.0) for value in analogue] == [0.0, 2.0, 0.0, 5.0]


def test_ambient_light_alone_gives_nothing_but_row_parity(sensor):
    exposure = wall(sensor, 3.0, radiance=0.0, ambient=0.5)
    half_e = 0.5 * electrons_per_radiance_second(sensor) * 0.5 * 6e-4
    expected = sensor.offset_ambient_lsb * half_e / sensor.full_well_e
    assert noise_free(exposure, sensor).dcs_lsb.abs().max() == 0
    flat = OffsetPattern(torch.zeros(1, 4, 5), torch.zeros(1, 4, 5))
    raw = noise_free(exposure, sensor, offsets=flat)
    assert torch.equal(raw.dcs_lsb[0, :, 0::2], torch.full((8, 2, 5), float(round(expected))))
    assert torch.equal(raw.dcs_lsb[0, :, 1::2], torch.full((8, 2, 5), -float(round(expected))))


def test_offset_pattern_has_its_std_and_row_structure(sensor):
    offsets = draw_offsets(sensor, 400, 500, generator=stream(Purpose.OFFSETS, 3))
    pattern = offsets.pattern_lsb[0]
    assert float(pattern.std()) == pytest.approx(sensor.offset_std_lsb, rel=0.05)
    rows = pattern.mean(dim=1)
    assert float(rows.var()) == pytest.approx(0.5 * sensor.offset_std_lsb**2, rel=0.15)
    assert torch.allclose(offsets.calibrated_lsb, 0.95 * offsets.pattern_lsb)


def test_gray_exposure_aims_at_the_target_and_stops_at_its_limit(sensor):
    bright = torch.rand(1, 20, 30, generator=torch.Generator().manual_seed(0)) + 0.5
    gray, _ = capture_gray(bright, sensor, noise=None)
    assert float(gray.float().mean()) == pytest.approx(0.3 * 4095, abs=1)
    dark, longest_s = capture_gray(torch.full((1, 4, 4), 1e-4), sensor, noise=None)
    assert longest_s.item() == pytest.approx(sensor.gray_max_exposure_s)
    expected = electrons_per_radiance_second(sensor) * 1e-4 * 5e-3 / sensor.full_well_e * 4095
    assert (dark - expected).abs().max() <= 0.5
    black, _ = capture_gray(torch.zeros(1, 2, 2), sensor, noise=None)
    assert black.max() == 0
    _, shortest_s = capture_gray(torch.full((1, 4, 4), 1e9), sensor, noise=None)
    assert shortest_s.item() == pytest.approx(1e-5)


def test_the_sensor_knows_its_ambient_noise_from_gray(sensor):
    ambient = torch.full((1, 3, 3), 0.7)
    gray, exposure_s = capture_gray(ambient, sensor, noise=None)
    integration_s = torch.tensor([6e-4])
    ambient_e = electrons_per_radiance_second(sensor) * 0.7 * 6e-4
    noise_lsb = sensor.gain_lsb_per_e * math.sqrt(ambient_e + 2 * sensor.read_noise_e**2)
    expected = math.hypot(noise_lsb, math.sqrt(1 / 12))  # rounding to words
    found = sample_noise_lsb(gray, exposure_s, integration_s, sensor)
    assert found.mean().item() == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("name", ["correlation", "active", "ambient"])
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_light_that_is_not_finite_is_refused(sensor, name, value):
    exposure = wall(sensor, 2.0)
    getattr(exposure, name)[0, ..., 1, 1] = value
    with pytest.raises(ValueError, match=name):
        noise_free(exposure, sensor)


def test_other_bad_input_is_refused(sensor):
    exposure = wall(sensor, 2.0)
    with pytest.raises(ValueError, match="laser_power_w"):
        noise_free(exposure, sensor, power_w=-1.0)
    with pytest.raises(ValueError, match="integration_s"):
        noise_free(exposure, sensor, integration_s=math.nan)
    with pytest.raises(ValueError, match="laser_power_w"):
        noise_free(exposure, sensor, batch=2)
    with pytest.raises(ValueError, match="noise"):
        expose(
            exposure,
            sensor,
            shots=Shots.FOUR,
            noise=torch.zeros(1, 2, 2, 4, 5),
            offsets=None,
            **settings(),
        )
    with pytest.raises(ValueError, match="3"):
        noise_free(exposure, sensor, shots=3)
    negative = Exposure(exposure.correlation, exposure.active, -exposure.ambient, exposure.active)
    with pytest.raises(ValueError, match="ambient"):
        noise_free(negative, sensor)
