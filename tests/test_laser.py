"""Laser: energy by hand, the exact thermal solution, the trip and the shape of the problem."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from shotenv.config import LaserConfig, SensorConfig, find_config, read_config
from shotenv.laser import shot_cost, thermal_step, trip_step


@pytest.fixture(scope="module")
def laser() -> LaserConfig:
    return read_config(LaserConfig, find_config("laser", "vcsel"))


def cost(laser, shots, power_w=7.0, integration_s=6e-4, macs=1e9):
    one = torch.ones(len(shots), dtype=torch.float64)
    return shot_cost(
        torch.tensor(shots),
        laser,
        optical_power_w=power_w * one,
        integration_s=integration_s * one,
        frame_period_s=0.1,
        network_macs=macs,
    )


def test_energy_of_each_choice_by_hand(laser):
    found = cost(laser, [0, 2, 4, 8])
    for row, shots in enumerate((0, 2, 4, 8)):
        on_s = shots * 6e-4
        laser_j = on_s * 7.0 / 0.42
        network_j = 1e9 * 1e-12 if shots in (2, 4) else 0.0
        total_j = laser_j + 2.1 * on_s + (shots + 1) * 0.26e-3 + 62e-3 * 0.1 + network_j
        assert found.laser_energy_j[row].item() == pytest.approx(laser_j)
        assert found.energy_j[row].item() == pytest.approx(total_j)
        assert found.duty[row].item() == pytest.approx(on_s / 0.1)
        assert found.heat_j[row].item() == pytest.approx(laser_j - 7.0 * on_s)


@pytest.mark.parametrize("as_array", [np.array, torch.tensor])
def test_heat_follows_the_exponential_whatever_the_step(laser, as_array):
    heat_w, ambient_k, start_k = 0.4, 300.0, 310.0
    steady_k = ambient_k + laser.thermal_resistance_k_per_w * heat_w
    for steps in (1, 10, 1000):
        period_s = 7.0 / steps
        temperature_k = as_array([start_k])
        for _ in range(steps):
            temperature_k = thermal_step(
                temperature_k, heat_w * period_s, ambient_k, laser, period_s
            )
        decay = math.exp(-7.0 / laser.thermal_time_constant_s)
        expected_k = steady_k + (start_k - steady_k) * decay
        assert float(temperature_k[0]) == pytest.approx(expected_k, rel=1e-6)


def test_trip_has_hysteresis(laser):
    below, between, above = laser.release_k - 1, laser.release_k + 1, laser.trip_k + 1
    temperature_k = torch.tensor([below, between, above, below, between, above])
    tripped = torch.tensor([False, False, False, True, True, True])
    expected = [False, False, True, False, True, True]
    assert trip_step(tripped, temperature_k, laser).tolist() == expected
    assert np.array_equal(
        trip_step(tripped.numpy(), temperature_k.numpy(), laser),
        trip_step(tripped, temperature_k, laser).numpy(),
    )


def test_defaults_make_planning_worthwhile(laser):
    """Trip and release lie at about .6 and .5 of the always-8 rise, for most drives near it."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    unit = np.random.default_rng(0).random((3, 10_000))
    power_w, integration_s = (
        low * (high / low) ** u
        for (low, high), u in zip((laser.optical_power_w, sensor.integration_s), unit, strict=False)
    )
    ambient_k = laser.ambient_k[0] + unit[2] * (laser.ambient_k[1] - laser.ambient_k[0])
    heat_w = power_w * (1 / laser.efficiency - 1) * 8 * integration_s * 10.0
    rise_k = laser.thermal_resistance_k_per_w * heat_w
    trip, release = (laser.trip_k - ambient_k) / rise_k, (laser.release_k - ambient_k) / rise_k
    assert np.median(trip) == pytest.approx(0.6, abs=0.05)
    assert np.median(release) == pytest.approx(0.5, abs=0.05)
    # Eight always trips, four never does, in most drives; in the others at least one of the two.
    assert np.mean((trip < 0.95) & (trip > 0.5)) > 0.75
