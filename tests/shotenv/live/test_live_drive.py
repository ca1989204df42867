"""A drive over the socket is the drive that the environment plays of the bank."""

from __future__ import annotations

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
import torch
from helpers.served_drives import example_module, samples_of_drive, served_drive

import shotenv  # noqa: F401 - registers the environments
from agents.policies import NetworkPolicy, Provenance, score_network
from shotenv.config import find_config, read_config
from shotenv.decision import FEATURE_NAMES, acquire_depth, look_at_scenes
from shotenv.live import EpcCamera, LiveShotScheduleEnv
from unwrap.cameras.files import CameraDescription

FRAMES = 21
INTEGRATION_S, AMBIENT_K, CENTI_CELSIUS = 400e-6, 293.15, 3000
WIRE = read_config(CameraDescription, find_config("camera", "epc660_wire"))


@pytest.fixture
def bank_env(tiny_kwargs):
    """The environment on the tiny bank, with gray exposures of whole microseconds.

    The wire knows no others.
    """
    kwargs = {**tiny_kwargs, "frames_per_drive": FRAMES}
    env = gymnasium.make("shotenv/ShotSchedule-v0", **kwargs).unwrapped
    problem = env.problem
    problem.bank.gray_exposure_s[:] = np.rint(problem.bank.gray_exposure_s * 1e6) * 1e-6
    scenes = look_at_scenes(problem.bank, problem.clips, problem.kept, problem.config.sensor)
    env.problem = replace(problem, scenes=scenes)
    return env


def any_scheduler():
    """An untrained network, which takes every action somewhere."""
    torch.manual_seed(3)
    network = score_network((len(FEATURE_NAMES), 16, 3), "tanh")
    network[0].weight.data.mul_(4.0)
    return NetworkPolicy(network, Provenance(algorithm="none", feature_names=FEATURE_NAMES))


def client(server, drive, **changes):
    """A camera at the server, set as the drive's."""
    kwargs = {
        "description": WIRE,
        "frequencies_hz": (24e6, 10e6),
        "laser_power_w": float(drive.laser_power_w),
        "integration_s": float(drive.integration_s),
        "size": (24, 32),
    }
    return EpcCamera("127.0.0.1", server.port, **(kwargs | changes))


def begun(env, laser_power_w=2.0):
    """Observation, info and drive of a drive that the wire can tell of."""
    settings = {
        "laser_power_w": laser_power_w,
        "integration_s": INTEGRATION_S,
        "ambient_k": AMBIENT_K,
    }
    observation, info = env.reset(seed=5, options=settings)
    return observation, info, env.state.drive


def test_a_live_drive_is_the_drive_of_the_bank(bank_env, tiny_kwargs):
    observation, info, drive = begun(bank_env)
    start_k = float(drive.start_k)
    policy, deep = any_scheduler(), []
    frames = served_drive(bank_env.problem, drive)
    bank = bank_env.problem.bank
    rows = drive.frames[0].tolist()
    speeds = iter([(bank.ego_speed_m_s[row], bank.yaw_rate_rad_s[row]) for row in rows])
    emulated = example_module("emulated_camera")
    with emulated.EmulatedCamera(frames, centi_celsius=CENTI_CELSIUS) as server:
        live = LiveShotScheduleEnv(
            client(server, drive),
            unwrapper=tiny_kwargs["unwrapper"],
            frames_per_drive=FRAMES,
            offset_lsb=drive.offsets.calibrated_lsb[0],
            shift_m=float(drive.drift_m),
            ego=lambda: next(speeds),
            deliver=lambda depth, shots: deep.append((depth, shots)),
            stale_s=60.0,
        )
        with live:
            seen, told = live.reset(options={"laser_k": start_k, "drive": info["drive_seed"]})
            chosen, over = [], False
            while not over:
                np.testing.assert_array_equal(seen, observation)
                assert told["temperature_k"] == info["temperature_k"]
                assert (live.action_masks() == bank_env.action_masks()).all()
                action = policy.act(seen, told)
                assert action == policy.act(observation, info)
                at, before = torch.tensor([len(chosen)]), bank_env.state
                observation, _, over, _, info = _played(bank_env, action)
                seen, _, _, ended, told = live.step(action)
                assert ended == over
                for key in ("shots", "energy_j", "laser_energy_j", "temperature_k", "duty"):
                    assert told[key] == info[key], key
                depth, shots = deep[-1]
                expected = acquire_depth(bank_env.problem, before.drive, at, shots)
                words, full = samples_of_drive(bank_env.problem, drive, len(chosen))
                np.testing.assert_array_equal(expected.raw.dcs_lsb[0], words[: int(shots)])
                assert not full.any()
                torch.testing.assert_close(
                    depth.distance_m, expected.depth.distance_m, rtol=0, atol=0, equal_nan=True
                )
                assert torch.equal(depth.valid, expected.depth.valid)
                chosen.append(action)
    assert set(chosen) == {0, 1, 2} and len(deep) == FRAMES


def _played(env, action):
    observation, reward, _, over, info = env.step(action)
    return observation, reward, over, None, info
