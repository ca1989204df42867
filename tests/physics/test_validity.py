"""How often the sky, which returns nothing, is called valid: closed forms, and the whole sensor."""

import math

import pytest
import torch

from shotenv.sensor.acquisition import expose
from shotenv.sensor.description import description_of
from shotenv.sensor.drift import imager_temperature_k
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.gray import capture_gray, sample_noise_lsb
from shotenv.sensor.noise import Purpose, draw_noise, stream
from shotenv.sensor.offsets import draw_offsets, offset_left_lsb
from unwrap.depth.correction import correct
from unwrap.depth.kernel_density import unwrap_kernel_density
from unwrap.depth.merge import RULES
from unwrap.signal.description import SensorDescription
from unwrap.signal.frames import RawFrame
from unwrap.signal.shots import Shots

HEIGHT, WIDTH = 240, 320
POWER_W, INTEGRATION_S = torch.tensor([7.0]), torch.tensor([6.5e-4])
MOST = 0.012
"""False alarms allowed with any number of samples."""
PREDICTED_M = torch.full((1, HEIGHT, WIDTH), 9.0)


def share(valid):
    return float(valid.double().mean())


def noise_alone(count, seed=3):
    """Samples of nothing but normal noise of 4 LSB."""
    generator = torch.Generator().manual_seed(seed)
    samples = 4.0 * torch.randn(4, count, HEIGHT, WIDTH, generator=generator)
    return RawFrame(samples, torch.zeros(4, HEIGHT, WIDTH, dtype=torch.bool))


@pytest.mark.parametrize("merge", list(RULES))
@pytest.mark.parametrize("snr", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("shots", list(Shots))
def test_noise_alone_passes_as_often_as_its_closed_form(shots, snr, merge):
    """exp(-k^2 / 2) in two samples, exp(-k^2) in the four of f1, whatever merges them."""
    sensor = SensorDescription(min_snr=snr, noise_lsb=4.0)
    raw = noise_alone(int(shots))
    frame = correct(raw, PREDICTED_M.expand(4, -1, -1).contiguous(), sensor, merge=merge)
    expected = math.exp(-(snr**2) / (2 if shots == Shots.TWO else 1))
    deviation = math.sqrt(expected / frame.valid.numel())
    assert share(frame.valid) == pytest.approx(expected, abs=5 * deviation)


def test_two_frequencies_alone_ask_both_amplitudes():
    """Each passes with exp(-k^2); where both do, every second pixel agrees within 1 m by chance."""
    sensor = SensorDescription(min_snr=1.0, noise_lsb=4.0)
    both = math.exp(-2.0)
    agreeing = share(correct(noise_alone(8), None, sensor).valid)
    lenient = SensorDescription(min_snr=1.0, noise_lsb=4.0, max_residual_m=99.0)
    assert share(correct(noise_alone(8), None, lenient).valid) == pytest.approx(both, rel=0.02)
    assert 0.45 * both < agreeing < 0.65 * both


def test_a_weak_second_frequency_leaves_the_wraps_to_the_prediction():
    """A strong f1 at phase 0, nothing at f2: 4 DCS would say 6.2457 m, and so do 8."""
    samples = torch.tensor([100.0, 0, -100, 0, 0, 0, 0, 0]).view(1, 8, 1, 1)
    raw, sensor = RawFrame(samples, torch.zeros(1, 1, 1, dtype=torch.bool)), SensorDescription()
    frame = correct(raw, torch.full((1, 1, 1), 7.0), sensor)
    assert bool(frame.valid) and float(frame.distance_m) == pytest.approx(6.2457, abs=1e-3)
    assert not bool(correct(raw, None, sensor).valid)


def sky(sensor, ambient, imager_k):
    """Valid shares of sky of this radiance by number of samples, the whole sensor's noise."""
    dark = torch.zeros(1, HEIGHT, WIDTH)
    exposure = Exposure(torch.zeros(1, 8, HEIGHT, WIDTH), dark, dark + ambient, dark + math.inf)
    temperature_k = torch.tensor([imager_k], dtype=torch.float64)
    generator = stream(Purpose.OFFSETS, 3)
    offsets = draw_offsets(sensor, HEIGHT, WIDTH, generator=generator, imager_k=imager_k)
    normals = torch.randn(dark.shape, generator=torch.Generator().manual_seed(1))
    gray, exposure_s = capture_gray(exposure.ambient, sensor, noise=normals)
    known, noise, found = description_of(sensor), draw_noise(5, 6, 8, HEIGHT, WIDTH)[None], {}
    for shots in Shots:
        raw = expose(
            exposure,
            sensor,
            shots=shots,
            laser_power_w=POWER_W,
            integration_s=INTEGRATION_S,
            noise=noise,
            offsets=offsets,
        )
        two = shots == Shots.TWO
        noise_lsb = sample_noise_lsb(
            gray,
            exposure_s,
            INTEGRATION_S,
            sensor,
            offset_left_lsb=offset_left_lsb(sensor, temperature_k) if two else None,
        )
        offset_lsb = offsets.calibrated_lsb if two else None
        told = {"noise_lsb": noise_lsb, "offset_lsb": offset_lsb}
        for merge in RULES:
            found[shots, merge] = share(
                correct(raw, PREDICTED_M, known, merge=merge, **told).valid & ~raw.saturated
            )
    found["two_frequencies"] = share(correct(raw, None, known, **told).valid)
    found["kernel_density"] = share(unwrap_kernel_density(raw, known, **told).depth.valid)
    return found


@pytest.mark.parametrize("outside_k", [283.0, 318.0])
@pytest.mark.parametrize("ambient", [0.0, 0.05, 0.5, 1.5])
def test_sky_is_seldom_valid_whatever_the_samples(sensor, ambient, outside_k):
    imager_k = float(imager_temperature_k(sensor, torch.tensor(outside_k)))
    found = sky(sensor, ambient, imager_k)
    assert max(found.values()) <= MOST, found
    # And not because nothing is ever valid: two samples see noise, and see it pass sometimes.
    assert found[Shots.TWO, "nearest"] > 1e-4
    assert max(value for key, value in found.items() if key[0] != Shots.TWO) < 1e-3


def test_without_counting_the_offset_two_samples_see_things_in_the_sky(sensor):
    """What makes the estimate of two samples another one: .035 in the dark, .07 in the light."""
    dark = torch.zeros(1, HEIGHT, WIDTH)
    exposure = Exposure(torch.zeros(1, 8, HEIGHT, WIDTH), dark, dark + 1.5, dark + math.inf)
    offsets = draw_offsets(sensor, HEIGHT, WIDTH, generator=stream(Purpose.OFFSETS, 3))
    raw = expose(
        exposure,
        sensor,
        shots=Shots.TWO,
        laser_power_w=POWER_W,
        integration_s=INTEGRATION_S,
        noise=draw_noise(5, 6, 8, HEIGHT, WIDTH)[None],
        offsets=offsets,
    )
    gray, exposure_s = capture_gray(exposure.ambient, sensor, noise=None)
    noise_lsb = sample_noise_lsb(gray, exposure_s, INTEGRATION_S, sensor)
    known, offset_lsb = description_of(sensor), offsets.calibrated_lsb
    frame = correct(raw, PREDICTED_M, known, noise_lsb=noise_lsb, offset_lsb=offset_lsb)
    assert share(frame.valid) > 4 * MOST
