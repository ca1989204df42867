"""Samples about the full well, against two taps of independent Poisson electrons cut off there."""

import math

import numpy as np
import pytest
import torch

from shotenv.config.reader import merged
from shotenv.sensor.acquisition import expose
from shotenv.sensor.electrons import electrons_per_radiance_second
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.noise import draw_noise
from unwrap.signal.shots import Shots

SIDE = 500
CONTRAST, POWER_W, INTEGRATION_S = 0.6, 7.0, 6.5e-4


def first_sample(sensor, signal_e, ambient_e, *, noisy=True):
    """D0 of `signal_e` and `ambient_e` over both taps at phase 0, in electrons, over an image."""
    # Words of 5 electrons, and range for two full taps' difference.
    fine = merged(
        sensor,
        {"contrast": CONTRAST, "gain_lsb_per_e": 0.2, "adc_bits": 16, "harmonic_strength": 0.0},
    )
    rate = electrons_per_radiance_second(fine) * INTEGRATION_S
    blank = torch.zeros(1, SIDE, SIDE)
    active = blank + signal_e / (rate * POWER_W)
    exposure = Exposure(active.expand(8, -1, -1)[None], active, blank + ambient_e / rate, blank)
    raw = expose(
        exposure,
        fine,
        shots=Shots.TWO,
        laser_power_w=torch.tensor([POWER_W]),
        integration_s=torch.tensor([INTEGRATION_S]),
        noise=draw_noise(3, 4, 8, SIDE, SIDE)[None] if noisy else None,
        offsets=None,
    )
    return raw.dcs_lsb[0, 0].double().numpy() / fine.gain_lsb_per_e


def two_taps(sensor, signal_e, ambient_e, *, count=2_000_000):
    """Mean and standard deviation of their difference: Poisson, full well, reading."""
    random, taps = np.random.default_rng(7), []
    for sign in (1, -1):
        mean_e = (signal_e * (1 + sign * CONTRAST) + ambient_e) / 2
        held_e = np.minimum(random.poisson(mean_e, count), sensor.full_well_e)
        taps.append(held_e + sensor.read_noise_e * random.standard_normal(count))
    difference_e = taps[0] - taps[1]
    return difference_e.mean(), difference_e.std()


# Tap A as a share of the full well: far below, one, half and no standard deviation (1/400) below,
# as far above, and far above; tap B in the dark, half full, and full itself.
LEVELS = [0.5, 0.99, 0.9975, 0.99875, 1.0, 1.00125, 1.0025, 1.005, 1.02, 1.5, 3.0]


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("ambient_share", [0.0, 0.5])
def test_mean_and_deviation_are_those_of_two_cut_off_taps(sensor, level, ambient_share):
    tap_e = level * sensor.full_well_e
    ambient_e = 2 * tap_e * ambient_share
    signal_e = 2 * (tap_e - ambient_e / 2) / (1 + CONTRAST)
    found_e = first_sample(sensor, signal_e, ambient_e)
    mean_e, deviation_e = two_taps(sensor, signal_e, ambient_e)
    assert found_e.mean() == pytest.approx(mean_e, rel=0.01, abs=0.01 * deviation_e)
    assert found_e.std() == pytest.approx(deviation_e, rel=0.01)


def test_two_full_taps_differ_by_the_noise_of_reading_them(sensor):
    found_e = first_sample(sensor, 1e5, 10 * sensor.full_well_e)
    assert found_e.mean() == pytest.approx(0.0, abs=1.0)
    assert found_e.std() == pytest.approx(math.sqrt(2) * sensor.read_noise_e, rel=0.01)


@pytest.mark.parametrize("level", [0.9, 0.999, 1.0, 1.001, 2.0])
def test_without_noise_a_tap_is_cut_off_and_nothing_else(sensor, level):
    tap_e = level * sensor.full_well_e
    signal_e = 2 * tap_e / (1 + CONTRAST)
    found_e = first_sample(sensor, signal_e, 0.0, noisy=False)
    low_e = signal_e * (1 - CONTRAST) / 2
    expected_e = min(tap_e, sensor.full_well_e) - min(low_e, sensor.full_well_e)
    assert np.abs(found_e - expected_e).max() <= 2.6  # half a word of 5 electrons, and float32
