"""Laser: energy by hand, closed forms of heat, derating, ageing and eye safety, bad input."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
from scipy.integrate import solve_ivp

from shotenv.config.laser import LaserConfig
from shotenv.config.reader import ConfigError, find_config, merged, read_config
from shotenv.config.sensor import SensorConfig
from shotenv.laser.ageing import ageing_rate
from shotenv.laser.energy import NetworkWork, efficiency_at, emitted_power_w, shot_cost
from shotenv.laser.laser_state import LaserState, laser_step, start_laser, too_bright
from shotenv.laser.thermal import case_step, junction_step, trip_step

PERIOD_S = 0.1
NETWORK = NetworkWork(1e9)
NETWORK = NetworkWork(gray=1e9)
ENERGY_PARTS = ("laser", "driver", "readout", "static", "network")


@pytest.fixture(scope="module")
def laser() -> LaserConfig:
    return read_config(LaserConfig, find_config("laser", "vcsel"))


@pytest.fixture(scope="module")
def detailed() -> LaserConfig:
    return read_config(LaserConfig, find_config("laser", "vcsel_detailed"))


def kelvin(*values):
    return torch.tensor(values, dtype=torch.float64)


def cost(laser, shots, power_w=7.0, integration_s=6e-4, network=NETWORK, temperature_k=298.15):
    one = torch.ones(len(shots), dtype=torch.float64)
    return shot_cost(
        torch.tensor(shots),
        laser,
        optical_power_w=power_w * one,
        temperature_k=temperature_k * one,
        integration_s=integration_s * one,
        frame_period_s=PERIOD_S,
        network=network,
    )


def heating(heat_w):
    """A frame that only heats, with this flow."""
    flow = kelvin(heat_w)
    return dataclasses.replace(cost(LaserConfig(name="any"), [0]), heat_j=flow * PERIOD_S)


def shining(optical_w):
    """A frame that only shines, with this mean power."""
    power = kelvin(optical_w)
    return dataclasses.replace(cost(LaserConfig(name="any"), [0]), optical_j=power * PERIOD_S)


def after(frames, frame, laser, start, ambient_k=300.0):
    state = start
    for _ in range(frames):
        state = laser_step(state, frame, kelvin(ambient_k), laser, PERIOD_S)
    return state


# Energy


def test_energy_of_each_choice_by_hand(laser):
    found = cost(laser, [0, 2, 4, 8])
    for row, shots in enumerate((0, 2, 4, 8)):
        on_s = shots * 6e-4
        laser_j = on_s * 7.0 / 0.42
        # Every observation tells the prediction, whatever is taken then.
        network_j = 1e9 * 1e-12
        total_j = laser_j + 2.1 * on_s + (shots + 1) * 0.26e-3 + 62e-3 * 0.1 + network_j
        assert found.laser_energy_j[row].item() == pytest.approx(laser_j)
        assert found.driver_energy_j[row].item() == pytest.approx(2.1 * on_s)
        assert found.readout_energy_j[row].item() == pytest.approx((shots + 1) * 0.26e-3)
        assert found.static_energy_j[row].item() == pytest.approx(6.2e-3)
        assert found.network_energy_j[row].item() == pytest.approx(network_j)
        assert found.energy_j[row].item() == pytest.approx(total_j)
        assert found.duty[row].item() == pytest.approx(on_s / 0.1)
        assert found.heat_j[row].item() == pytest.approx(laser_j - 7.0 * on_s)


def test_a_network_that_looks_at_samples_runs_where_there_are_some(laser):
    found = cost(laser, [0, 2, 4, 8], network=NetworkWork(gray=1e9, samples=3e9))
    assert found.network_energy_j.tolist() == pytest.approx([1e-3, 4e-3, 7e-3, 10e-3])


@pytest.mark.parametrize("temperature_k", [290.0, 320.0, 336.0])
def test_the_parts_make_the_energy_and_light_and_heat_make_the_lasers(detailed, temperature_k):
    found = cost(detailed, [0, 2, 4, 8], temperature_k=temperature_k)
    parts = [getattr(found, f"{part}_energy_j") for part in ENERGY_PARTS]
    torch.testing.assert_close(sum(parts), found.energy_j)
    torch.testing.assert_close(found.heat_j + found.optical_j, found.laser_energy_j)
    for field in dataclasses.fields(found):
        assert (getattr(found, field.name) >= 0).all(), field.name


@pytest.mark.parametrize("as_array", [np.array, torch.tensor])
def test_efficiency_falls_linearly_above_25_c(detailed, as_array):
    found = efficiency_at(as_array([280.0, 298.15, 308.15, 337.15, 400.0]), detailed)
    np.testing.assert_allclose(found, [0.42, 0.42, 0.40, 0.342, 0.342], rtol=1e-6)


def test_a_warm_laser_takes_more_for_the_same_light(laser, detailed):
    cold, warm = (cost(detailed, [8], temperature_k=k) for k in (298.15, 328.15))
    assert warm.optical_j == cold.optical_j
    assert warm.laser_energy_j.item() == pytest.approx(cold.laser_energy_j.item() * 0.42 / 0.36)
    flat = [cost(laser, [8], temperature_k=k).energy_j.item() for k in (298.15, 328.15)]
    assert flat[0] == flat[1]


def test_derating_curve(laser, detailed):
    temperature_k = np.array([300.0, 328.15, 333.15, 338.15, 344.816666, 360.0])
    found = emitted_power_w(8.0, temperature_k, detailed)
    np.testing.assert_allclose(found, 8.0 * np.array([1, 1, 0.85, 0.7, 0.5, 0.5]), rtol=1e-6)
    assert emitted_power_w(8.0, temperature_k, laser) == 8.0


# Heat


@pytest.mark.parametrize("as_array", [np.array, torch.tensor])
def test_heat_follows_the_exponential_whatever_the_step(laser, as_array):
    heat_w, ambient_k, start_k = 0.4, 300.0, 310.0
    steady_k = ambient_k + laser.thermal_resistance_k_per_w * heat_w
    for steps in (1, 10, 1000):
        period_s = 7.0 / steps
        temperature_k = as_array([start_k])
        for _ in range(steps):
            temperature_k = case_step(temperature_k, heat_w * period_s, ambient_k, laser, period_s)
        decay = math.exp(-7.0 / laser.thermal_time_constant_s)
        expected_k = steady_k + (start_k - steady_k) * decay
        assert float(temperature_k[0]) == pytest.approx(expected_k, rel=1e-6)


def test_two_stages_answer_a_step_with_two_exponentials(detailed):
    for frames in (1, 5, 20, 100, 400):
        state = after(frames, heating(0.4), detailed, start_laser(kelvin(300.0)))
        time_s = frames * PERIOD_S
        rise_k = 25.0 * 0.4 * -math.expm1(-time_s / 1.0)
        case_k = 300.0 + 75.0 * 0.4 * -math.expm1(-time_s / 10.0)
        assert state.junction_rise_k.item() == pytest.approx(rise_k)
        assert state.temperature_k.item() == pytest.approx(case_k + rise_k)
    assert after(3000, heating(0.4), detailed, start_laser(kelvin(300.0))).temperature_k.item() == (
        pytest.approx(300.0 + 100.0 * 0.4)
    )


def test_two_stages_agree_with_a_numerical_solution(detailed):
    """The same network as differential equations, with a heat flow that changes every frame."""
    flows = np.random.default_rng(0).uniform(0.0, 0.8, 40)
    state, numerical = start_laser(kelvin(310.0)), np.array([310.0, 0.0])
    for flow in flows:
        state = laser_step(state, heating(flow), kelvin(305.0), detailed, PERIOD_S)
        numerical = solve_ivp(
            lambda _, x, flow=flow: [(305.0 + 75.0 * flow - x[0]) / 10.0, 25.0 * flow - x[1]],
            (0.0, PERIOD_S),
            numerical,
            rtol=1e-10,
            atol=1e-12,
        ).y[:, -1]
    assert state.temperature_k.item() == pytest.approx(numerical.sum(), abs=1e-7)


def test_no_heat_is_lost(detailed):
    """What flowed into each stage is what it holds and what has flowed out of it."""
    resistances, constants_s = (75.0, 25.0), (10.0, 1.0)
    flows = np.random.default_rng(1).uniform(0.0, 0.8, 50)
    for resistance, constant_s in zip(resistances, constants_s, strict=True):
        rise_k, out_j = 0.0, 0.0
        for flow in flows:
            steady_k, share = resistance * flow, -math.expm1(-PERIOD_S / constant_s)
            # Integral of the exact exponential over the frame.
            mean_k = steady_k + (rise_k - steady_k) * share * constant_s / PERIOD_S
            out_j += mean_k / resistance * PERIOD_S
            if resistance == 25.0:
                rise_k = junction_step(rise_k, flow * PERIOD_S, detailed, PERIOD_S)
            else:
                rise_k = case_step(rise_k, flow * PERIOD_S, 0.0, detailed, PERIOD_S)
        held_j = rise_k * constant_s / resistance
        assert held_j + out_j == pytest.approx(flows.sum() * PERIOD_S)


def test_without_a_junction_stage_the_junction_is_the_case(laser):
    state = after(30, heating(0.4), laser, start_laser(kelvin(310.0)))
    expected_k = kelvin(310.0)
    for _ in range(30):
        expected_k = case_step(expected_k, heating(0.4).heat_j, 300.0, laser, PERIOD_S)
    assert state.temperature_k.item() == expected_k.item()
    assert state.junction_rise_k.item() == 0.0


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


def test_the_junction_trips_where_the_case_alone_would_not(detailed):
    """0.45 W settle at 333.75 K in the case and at 345 K in the junction."""
    alone = merged(detailed, {"junction_resistance_k_per_w": 0.0})
    start = start_laser(kelvin(300.0))
    assert not after(2000, heating(0.45), alone, start).tripped
    assert after(2000, heating(0.45), detailed, start).tripped


# Ageing


@pytest.mark.parametrize("as_array", [np.array, torch.tensor])
@pytest.mark.parametrize(("energy_ev", "factor"), [(0.55, 1.7477), (0.7, 2.0351)])
def test_ten_kelvin_age_by_the_published_factor(detailed, energy_ev, factor, as_array):
    """60 to 70 C: 1.75 times with 0.55 eV; twice, the rule of thumb, with 0.7 eV."""
    detailed = merged(detailed, {"activation_energy_ev": energy_ev})
    rate = ageing_rate(as_array([1.0, 1.0]), as_array([333.15, 343.15]), detailed)
    assert float(rate[1] / rate[0]) == pytest.approx(factor, rel=1e-4)


@pytest.mark.parametrize("size", [1, 7, 64])
def test_wear_does_not_depend_on_the_batch(detailed, size):
    random = torch.Generator().manual_seed(0)
    power_w, warmer = torch.rand(2, 2000, dtype=torch.float64, generator=random)
    temperature_k = 280.0 + 80.0 * warmer
    whole = ageing_rate(1.0 + power_w, temperature_k, detailed)
    parts = [
        ageing_rate(*both, detailed)
        for both in zip((1.0 + power_w).split(size), temperature_k.split(size), strict=True)
    ]
    assert torch.equal(torch.cat(parts), whole)


def test_rated_conditions_use_one_hour_in_an_hour(detailed):
    rated = kelvin(detailed.rated_power_w / detailed.efficiency)
    assert ageing_rate(rated, kelvin(detailed.rated_k), detailed).item() == pytest.approx(1.0)
    twice = ageing_rate(2 * rated, kelvin(detailed.rated_k), detailed)
    assert twice.item() == pytest.approx(2**2.01)


def test_life_is_used_only_while_on(laser, detailed):
    ageless = laser.model_copy(update={"ageing_exponent": 0.0, "activation_energy_ev": 0.0})
    plain = cost(ageless, [0, 2, 8]).life_used_h
    torch.testing.assert_close(plain, kelvin(0, 2, 8) * 6e-4 / 3600)
    hot = cost(detailed, [0, 8], power_w=7.15, temperature_k=333.15).life_used_h
    current = 0.42 / 0.35  # The efficiency that 35 K took away.
    assert hot[0] == 0.0
    assert hot[1].item() == pytest.approx(8 * 6e-4 / 3600 * current**2.01)


# Eye safety


def test_the_average_power_answers_a_step_with_the_window(detailed):
    for frames in (1, 50, 100, 2000):
        state = after(frames, shining(0.4), detailed, start_laser(kelvin(300.0)))
        expected_w = 0.4 * -math.expm1(-frames * PERIOD_S / 10.0)
        assert state.eye_power_w.item() == pytest.approx(expected_w)
        assert too_bright(state, detailed).item() == (expected_w > 0.25)


def test_a_short_flash_is_allowed_and_forgotten(detailed):
    start = start_laser(kelvin(300.0))
    flash = after(20, shining(0.9), detailed, start)
    assert not too_bright(flash, detailed).any()
    dark = after(100, shining(0.0), detailed, flash)
    assert dark.eye_power_w.item() == pytest.approx(flash.eye_power_w.item() / math.e)


def test_without_a_window_the_power_is_the_frames_and_nothing_is_too_bright(laser):
    state = after(3, shining(0.4), laser, start_laser(kelvin(300.0)))
    assert state.eye_power_w.item() == pytest.approx(0.4)
    assert not too_bright(state, laser).any()


def test_lasers_of_a_batch_do_not_mix(detailed):
    many = start_laser(kelvin(300.0, 320.0, 336.9))
    frame = cost(detailed, [2, 8, 8], temperature_k=320.0)
    found = laser_step(many, frame, kelvin(300.0, 305.0, 310.0), detailed, PERIOD_S)
    for row, ambient_k in enumerate((300.0, 305.0, 310.0)):
        one = start_laser(many.temperature_k[row : row + 1])
        part = type(frame)(
            **{k.name: getattr(frame, k.name)[[row]] for k in dataclasses.fields(frame)}
        )
        alone = laser_step(one, part, kelvin(ambient_k), detailed, PERIOD_S)
        for field in dataclasses.fields(LaserState):
            assert getattr(alone, field.name)[0] == getattr(found, field.name)[row]
    assert found.tripped.tolist() == [False, False, True]


# Bad input


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"optical_power_w": [0.0, 5.0]}, r"optical_power_w is \(0\.0, 5\.0\); expected above 0"),
        ({"optical_power_w": [9.0, 5.0]}, r"optical_power_w is \(9, 5\); expected low <= high"),
        ({"efficiency_slope_per_k": 0.02}, "efficiency_slope_per_k is 0.02, which takes 0.78 off"),
        ({"efficiency_slope_per_k": -0.001}, "efficiency_slope_per_k: .*got -0.001"),
        ({"derate_k": 340.0}, "derate_k is 340; expected below trip_k 337.15"),
        ({"derate_floor": 1.2}, "derate_floor: .*got 1.2"),
        ({"derate_floor": 0.0}, "derate_floor: .*got 0.0"),
        ({"derate_per_k": -0.1}, "derate_per_k: .*got -0.1"),
        ({"junction_time_constant_s": 12.0}, "junction_time_constant_s is 12; .* 10$"),
        ({"junction_resistance_k_per_w": -1.0}, "junction_resistance_k_per_w: .*got -1.0"),
        ({"ageing_exponent": float("nan")}, "ageing_exponent"),
        ({"activation_energy_ev": 55.0}, "activation_energy_ev: .*got 55.0"),
        ({"rated_power_w": 0.0}, "rated_power_w: .*got 0.0"),
        ({"eye_window_s": 0.0}, "eye_window_s is 0; expected the averaging time of eye_limit_w"),
        ({"eye_limit_w": float("inf")}, "eye_limit_w"),
        ({"release_k": 338.0}, "release_k is 338; expected .* below trip_k 337.15"),
        ({"derate": 0.1}, "unknown key derate"),
    ],
)
def test_impossible_lasers_are_refused(detailed, changes, named):
    with pytest.raises(ConfigError, match=named):
        merged(detailed, changes)


def test_what_is_off_is_not_checked(laser):
    merged(laser, {"derate_k": 400.0, "junction_time_constant_s": 100.0, "eye_window_s": 3.0})


def test_defaults_make_planning_worthwhile(laser):
    """Heat holds back always-8 in some drives and not in most, and always-2 next to never."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    unit = np.random.default_rng(0).random((3, 10_000))
    power_w, integration_s = (
        low * (high / low) ** u
        for (low, high), u in zip((laser.optical_power_w, sensor.integration_s), unit, strict=False)
    )
    ambient_k = laser.ambient_k[0] + unit[2] * (laser.ambient_k[1] - laser.ambient_k[0])
    heat_w = power_w * (1 / laser.efficiency - 1) * 8 * integration_s * 10.0
    rise_k = laser.thermal_resistance_k_per_w * heat_w
    # Of the rise that always-8 would settle at; that of n samples is n / 8 of it.
    room = (laser.trip_k - ambient_k) / rise_k
    assert 0.2 < np.mean(room < 1.0) < 0.4
    assert np.mean(room < 0.25) < 0.05
