"""Configuration of the imager: shipped files load, impossible values are refused with numbers."""

from __future__ import annotations

import math

import pytest

from shotenv.config.reader import ConfigError, configs_dir, find_config, merged, read_config
from shotenv.config.sensor import SensorConfig

SHIPPED = sorted(path.stem for path in (configs_dir() / "sensor").glob("*.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_sensors_are_valid_and_state_every_source(name):
    path = find_config("sensor", name)
    assert read_config(SensorConfig, path).name == name
    for line in path.read_text().splitlines():
        if line.split("#")[0].strip() and not line.startswith("name:"):
            assert "#" in line, f"{line!r} has no source"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"integration_s": (1e-3, 5e-3)}, ["integration_s", "0.005", "0.00385"]),
        ({"integration_s": (2e-3, 1e-3)}, ["integration_s", "0.002", "low <= high"]),
        ({"integration_s": (0.0, 1e-3)}, ["integration_s", "0 < t"]),
        ({"integration_s": (math.nan, 1e-3)}, ["integration_s", "nan"]),
        ({"f2_hz": 24e6}, ["f2_hz", "2.4e+07", "f1_hz"]),
        ({"max_range_m": 80.0}, ["max_range_m", "80", "74.95"]),
        ({"f2_hz": 12e6}, ["max_range_m", "25", "12.49", "1.2e+07"]),
        ({"saturation_range_m": 6.5}, ["saturation_range_m", "6.5", "6.246"]),
        ({"f1_hz": 24.0}, ["f1_hz", "100000"]),
        ({"f1_hz": math.inf}, ["f1_hz"]),
        ({"wavelength_nm": 9.4e-7}, ["wavelength_nm", "300"]),
        ({"pixel_pitch_m": 20.0}, ["pixel_pitch_m", "0.001"]),
        ({"calibration_temperature_k": 25.0}, ["calibration_temperature_k", "200"]),
        ({"distance_drift_m_per_k": 12.5}, ["distance_drift_m_per_k", "1"]),
        ({"self_heating_k": -1.0}, ["self_heating_k", "0"]),
        ({"offset_drift_lsb_per_k": math.nan}, ["offset_drift_lsb_per_k"]),
        ({"quantum_efficiency": 0.0}, ["quantum_efficiency"]),
        ({"contrast": 1.1}, ["contrast", "1.1"]),
        ({"harmonic_strength": 1.5}, ["harmonic_strength", "1.5"]),
        ({"harmonic_strength": 1.0, "highest_harmonic": 31}, ["contrast", "0.85", "1.035"]),
        ({"highest_harmonic": 4}, ["highest_harmonic", "4", "odd"]),
        ({"wiggle_calibrated_share": -0.1}, ["wiggle_calibrated_share", "-0.1"]),
        ({"drift_compensated_share": 2.0}, ["drift_compensated_share", "2"]),
        ({"sample_period_s": 3.85}, ["sample_period_s", "1"]),
        ({"f_number": 0.0}, ["f_number", "0.5"]),
        ({"full_well_e": 0.0}, ["full_well_e"]),
        ({"adc_bits": 12.5}, ["adc_bits"]),
        ({"dark_current": 1.0}, ["unknown key", "dark_current"]),
    ],
)
def test_impossible_values_are_refused_with_their_numbers(sensor, changes, words):
    with pytest.raises(ConfigError) as refused:
        merged(sensor, changes)
    for word in words:
        assert word in str(refused.value)
