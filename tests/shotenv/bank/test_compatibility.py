"""What was made for one sensor is refused by another: a walk over every field there is."""

from __future__ import annotations

import json
import shutil

import gymnasium as gym
import numpy as np
import pytest
import torch

import shotenv  # noqa: F401  registers the environments
from agents.cli.entry import main
from shotenv.bank.compatibility import BAKED_FIELDS, check_fits
from shotenv.bank.files.folders import bank_folder
from shotenv.bank.opening import open_bank
from shotenv.config.bank import BankConfig, CameraConfig, WorldConfig
from shotenv.config.laser import LaserConfig
from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import ACQUISITION_FIELDS, SensorConfig
from shotenv.sensor.gray import capture_gray
from unwrap.support.files import write_json

OTHER_SENSOR = {
    "f1_hz": 20e6,
    "f2_hz": 8e6,
    "sample_period_s": 3e-3,
    "integration_s": (1e-4, 2e-4),
    "harmonic_strength": 0.1,
    "highest_harmonic": 5,
    "wiggle_calibrated_share": 0.2,
    "distance_drift_m_per_k": 0.2,
    "drift_compensated_share": 0.2,
    "calibration_temperature_k": 320.0,
    "self_heating_k": 50.0,
    "wavelength_nm": 850.0,
    "f_number": 2.0,
    "lens_transmission": 0.5,
    "veiling_glare": 0.05,
    "veiling_glare_width": 0.5,
    "ghost": 0.01,
    "ghost_width": 0.1,
    "pixel_pitch_m": 10e-6,
    "fill_factor": 0.5,
    "quantum_efficiency": 0.5,
    "contrast": 0.5,
    "read_noise_e": 10.0,
    "full_well_e": 80e3,
    "gain_lsb_per_e": 0.02,
    "adc_bits": 10,
    "offset_std_lsb": 60.0,
    "offset_row_share": 0.1,
    "offset_calibrated_share": 0.1,
    "offset_ambient_lsb": 80.0,
    "offset_drift_lsb_per_k": 2.0,
    "gray_max_exposure_s": 1e-3,
    "gray_target": 0.5,
    "min_snr": 8.0,
    "saturation_range_m": 4.0,
    "max_range_m": 15.0,
}
OTHER_CAMERA = {
    "width": 80,
    "height": 80,
    "horizontal_fov_deg": 90.0,
    "samples_per_pixel": 2,
    "gray_instants": 2,
    "bounces": 3,
    "gray_filter_m": 0.1,
    "emission": {"edge_softness_deg": 2.0},
}
OTHER_WORLD = {
    "families": ("garage",),
    "speed_m_s": (1.0, 2.0),
    "frame_rate_hz": 5.0,
    "frames_per_clip": 3,
    "mounts": ({"position_m": (0.0, 0.5, 0.0)},),
}
OTHER_LASER = {
    "optical_power_w": (2.0, 3.0),
    "efficiency": 0.3,
    "efficiency_slope_per_k": 0.001,
    "derate_k": 330.0,
    "derate_per_k": 0.01,
    "derate_floor": 0.9,
    "driver_power_w": 5.0,
    "readout_energy_j": 1e-2,
    "static_power_w": 1.0,
    "energy_per_mac_j": 1e-9,
    "thermal_resistance_k_per_w": 10.0,
    "thermal_time_constant_s": 30.0,
    "junction_resistance_k_per_w": 50.0,
    "junction_time_constant_s": 5.0,
    "ambient_k": (290.0, 291.0),
    "trip_k": 350.0,
    "release_k": 325.0,
    "ageing_exponent": 1.0,
    "activation_energy_ev": 0.3,
    "rated_power_w": 3.0,
    "rated_k": 300.0,
    "eye_limit_w": 0.3,
    "eye_window_s": 1.0,
}
WARM = {"derate_k": 310.0, "derate_floor": 0.6, "eye_limit_w": 0.01, "eye_window_s": 3.0}
"""Over the laser with every effect: derated to the floor, and capped, in some frames."""


@pytest.fixture(scope="module")
def bank(tiny_bank):
    return open_bank(tiny_bank)


@pytest.fixture(scope="module")
def warm_laser():
    return read_config(LaserConfig, find_config("laser", "vcsel_detailed")).model_dump() | WARM


def delivered(**kwargs) -> np.ndarray:
    """All numbers that an environment delivers in 18 frames, [18, n]."""
    rows = []
    with gym.make("shotenv/ShotSchedule-v0", disable_env_checker=True, **kwargs) as env:
        env.reset(seed=4)
        for frame in range(18):
            features, reward, *_, info = env.step(frame % 3)
            numbers = [value for value in info.values() if isinstance(value, int | float)]
            rows.append([*features, reward, *numbers])
    return np.asarray(rows)


@pytest.fixture(scope="module")
def usual(tiny_kwargs):
    return delivered(**tiny_kwargs)


def test_every_field_has_another_value_here():
    assert set(OTHER_SENSOR) == set(SensorConfig.model_fields) - {"name"}
    assert set(OTHER_CAMERA) == set(CameraConfig.model_fields)
    assert set(OTHER_WORLD) == set(WorldConfig.model_fields)
    assert set(OTHER_LASER) == set(LaserConfig.model_fields) - {"name"}


def test_a_field_of_the_sensor_is_baked_or_applied_and_never_both():
    assert set(BAKED_FIELDS) | ACQUISITION_FIELDS == set(OTHER_SENSOR)
    assert not set(BAKED_FIELDS) & ACQUISITION_FIELDS


@pytest.mark.parametrize("field", BAKED_FIELDS)
def test_what_is_baked_into_a_bank_is_refused_with_both_values(bank, sensor, field):
    wanted = OTHER_SENSOR[field]
    near = merged(sensor, {"saturation_range_m": 3.0, "max_range_m": 12.0})  # for any frequencies
    other = merged(near, {field: wanted})
    expected = (
        f"sensor.{field} is {wanted:g}, but bank tiny was rendered with "
        f"{getattr(sensor, field):g}; render a bank with this sensor"
    )
    with pytest.raises(ValueError) as refused:
        check_fits(bank, other)
    assert str(refused.value) == expected
    folders = {bank_folder(BankConfig(name="tiny", sensor=one)) for one in (near, other)}
    assert len(folders) == 2


@pytest.mark.parametrize("field", sorted(ACQUISITION_FIELDS))
def test_what_is_applied_when_a_frame_is_acquired_changes_what_comes_out(
    sensor, tiny_kwargs, usual, field
):
    changes = {field: OTHER_SENSOR[field]}
    other = delivered(**tiny_kwargs, sensor=changes)
    assert other.shape == usual.shape and not np.array_equal(other, usual, equal_nan=True)
    # And the bank has no part in it.
    config, changed = BankConfig(name="tiny", sensor=sensor), merged(sensor, changes)
    assert bank_folder(merged(config, {"sensor": changes})) == bank_folder(config)
    ambient = torch.rand(1, 8, 9, generator=torch.Generator().manual_seed(0))
    images = [capture_gray(ambient, one, noise=ambient)[0] for one in (sensor, changed)]
    assert torch.equal(*images)


@pytest.mark.parametrize("field", sorted(OTHER_LASER))
def test_a_laser_is_applied_when_a_frame_is_acquired(tiny_kwargs, warm_laser, field):
    before = delivered(**tiny_kwargs, laser=warm_laser)
    after = delivered(**tiny_kwargs, laser=warm_laser | {field: OTHER_LASER[field]})
    assert not np.array_equal(before, after, equal_nan=True)


@pytest.mark.parametrize(
    ("section", "field"),
    [("camera", name) for name in OTHER_CAMERA] + [("world", name) for name in OTHER_WORLD],
)
def test_camera_and_worlds_are_the_banks_own(sensor, section, field):
    """No environment can ask for others; another bank has them, in a folder of its own."""
    config = BankConfig(name="tiny", sensor=sensor)
    values = {"camera": OTHER_CAMERA, "world": OTHER_WORLD}[section]
    assert bank_folder(merged(config, {section: {field: values[field]}})) != bank_folder(config)


def test_the_same_numbers_come_out_of_the_same_settings(tiny_kwargs, usual):
    """Or the walks above would prove nothing."""
    assert np.array_equal(delivered(**tiny_kwargs, sensor="epc660"), usual, equal_nan=True)


@pytest.mark.parametrize(
    ("kwargs", "words"),
    [
        ({"sensor": {"adc_bits": 10}}, "adc_bits is 10, but bank tiny was rendered with 12"),
        ({"frame_rate_hz": 20.0}, "frame_rate_hz is 20, but bank tiny was rendered at 10"),
    ],
)
def test_an_environment_refuses_what_its_bank_was_not_made_for(tiny_kwargs, kwargs, words):
    with pytest.raises(ValueError, match=words):
        gym.make("shotenv/ShotSchedule-v0", **tiny_kwargs, **kwargs)


def test_the_name_of_a_sensor_is_compared_by_nobody(bank, sensor):
    check_fits(bank, merged(sensor, {"name": "another"}), frame_rate_hz=10.0)


def changed_manifest(tiny_bank, folder, **changes) -> str:
    shutil.copytree(tiny_bank, folder)
    path = folder / "manifest.json"
    content = json.loads(path.read_text()) | changes
    del content["digest"]
    write_json(path, content)
    return str(folder)


def test_an_imported_bank_fits_everything(tiny_bank, tmp_path, sensor):
    imported = open_bank(changed_manifest(tiny_bank, tmp_path / "bank", config=None))
    check_fits(imported, merged(sensor, {"adc_bits": 10}), frame_rate_hz=3.0)


def test_frames_that_stand_alone_are_measured_at_any_frame_rate(
    tiny_bank, tiny_unwrapper, tmp_path
):
    config = json.loads((open_bank(tiny_bank).folder / "manifest.json").read_text())["config"]
    config["world"]["frame_rate_hz"] = 1.0
    folder = changed_manifest(tiny_bank, tmp_path / "slow", config=config)
    numbers = []
    for bank in (tiny_bank, folder):
        path = tmp_path / "numbers.json"
        words = ("unwrap", "evaluate", tiny_unwrapper, "--bank", bank, "--json", path)
        assert main([str(word) for word in words]) == 0
        numbers.append(json.loads(path.read_text()))
    assert numbers[0] == numbers[1] and numbers[0]["frames"] > 0
