"""A drive over the socket is the drive that the environment plays of the bank."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import gymnasium
import numpy as np
import pytest
import torch
from served_drives import client_of, example_module, samples_of_drive, served_drive

import shotenv  # noqa: F401 - registers the environments
from agents.policies import NetworkPolicy, Provenance, score_network
from shotenv.decision import FEATURE_NAMES, acquire_depth, look_at_scenes
from shotenv.live import LiveShotScheduleEnv, StaleFrameError
from unwrap.signal import Shots

FRAMES = 21
DARK_US, BRIGHT_US = 200, 400
"""Integration times without, and with full pixels."""
AMBIENT_K, CENTI_CELSIUS = 293.15, 3000
SAME = ("shots", "asked", "energy_j", "laser_energy_j", "temperature_k", "duty", "life_used_h")


@pytest.fixture
def bank_env(tiny_kwargs):
    """The environment on the tiny bank, with gray exposures of whole microseconds.

    The wire knows no others.
    """
    kwargs = {**tiny_kwargs, "frames_per_drive": FRAMES}
    env = gymnasium.make("shotenv/ShotSchedule-v0", **kwargs).unwrapped
    problem = env.problem
    # A copy: other tests have the bank itself.
    bank = copy.copy(problem.bank)
    bank.gray_exposure_s = np.rint(bank.gray_exposure_s * 1e6) * 1e-6
    scenes = look_at_scenes(bank, problem.clips, problem.kept, problem.config.sensor)
    exposures = torch.from_numpy(bank.gray_exposure_s)
    env.problem = replace(problem, bank=bank, gray_exposure_s=exposures, scenes=scenes)
    return env


def any_scheduler():
    """An untrained network, which takes every action somewhere."""
    torch.manual_seed(3)
    network = score_network((len(FEATURE_NAMES), 16, 3), "tanh")
    network[0].weight.data.mul_(4.0)
    return NetworkPolicy(network, Provenance(algorithm="none", feature_names=FEATURE_NAMES))


@dataclass
class Pair:
    """The same drive begun twice, of the bank and live.

    Attributes
    ----------
    env, live
        Environments.
    seen, told
        Observations and infos of both.
    delivered : list
        Depth frames of the live one, each with its shots.
    """

    env: gymnasium.Env
    live: LiveShotScheduleEnv
    seen: list
    told: list
    delivered: list

    def step(self, action):
        """Both take the action; whether the drive is over."""
        overs = []
        for place, env in enumerate((self.env, self.live)):
            self.seen[place], _, _, over, self.told[place] = env.step(action)
            overs.append(over)
        assert overs[0] == overs[1]
        return overs[0]


def begin_both(env, integration_us, make_server, **keywords):
    """The server of a drive, not running yet, and what begins both environments."""
    chosen = {"laser_power_w": 9.0, "integration_s": integration_us * 1e-6}
    observation, info = env.reset(seed=5, options={**chosen, "ambient_k": AMBIENT_K})
    problem, drive = env.problem, env.state.drive
    server = make_server(served_drive(problem, drive), centi_celsius=CENTI_CELSIUS)

    def begin():
        bank, rows, delivered = problem.bank, iter(drive.frames[0].tolist()), []

        def ego():
            row = next(rows)
            return float(bank.ego_speed_m_s[row]), float(bank.yaw_rate_rad_s[row])

        live = LiveShotScheduleEnv(
            client_of(server, float(drive.laser_power_w), float(drive.integration_s)),
            unwrapper=problem.config.unwrapper,
            frames_per_drive=FRAMES,
            offset_lsb=drive.offsets.calibrated_lsb[0],
            shift_m=float(drive.drift_m),
            ego=ego,
            deliver=lambda depth, shots: delivered.append((depth, shots)),
            **{"stale_s": 60.0, **keywords},
        )
        start = {"drive": info["drive_seed"]}
        if "laser" not in keywords:
            start["laser_k"] = float(drive.start_k)
        seen, told = live.reset(options=start)
        return Pair(env, live, [observation, seen], [info, told], delivered)

    return server, begin


def emulated():
    return example_module("emulated_camera").EmulatedCamera


def test_a_live_drive_is_the_drive_of_the_bank_to_the_last_bit(bank_env):
    server, begin = begin_both(bank_env, DARK_US, emulated())
    policy, chosen, over = any_scheduler(), [], False
    with server:
        pair = begin()
        while not over:
            np.testing.assert_array_equal(*pair.seen)
            np.testing.assert_array_equal(pair.live.action_masks(), bank_env.action_masks())
            actions = [policy.act(*each) for each in zip(pair.seen, pair.told, strict=True)]
            assert actions[0] == actions[1]
            before = bank_env.state
            over = pair.step(actions[0])
            assert {key: pair.told[0][key] for key in SAME} == {
                key: pair.told[1][key] for key in SAME
            }
            depth, shots = pair.delivered[-1]
            expected = acquire_depth(bank_env.problem, before.drive, before.step, shots)
            assert not expected.raw.saturated.any()
            for name in ("distance_m", "valid", "phase_rad", "amplitude"):
                found, wanted = getattr(depth, name), getattr(expected.depth, name)
                np.testing.assert_array_equal(found.numpy(), wanted.numpy(), name)
            assert expected.depth.valid.any() and int(shots) == pair.told[0]["shots"]
            chosen.append(actions[0])
        pair.live.close()
    assert set(chosen) == {0, 1, 2} and len(pair.delivered) == FRAMES


def test_of_full_pixels_the_words_are_lost_and_nothing_else(bank_env):
    """A code stands for the sample: such pixels are flagged, and have the network's distance."""
    server, begin = begin_both(bank_env, BRIGHT_US, emulated())
    full = 0
    with server:
        pair = begin()
        for action in [2, 1, 0] * (FRAMES // 3):
            before = bank_env.state
            pair.step(action)
            depth, shots = pair.delivered[-1]
            expected = acquire_depth(bank_env.problem, before.drive, before.step, shots)
            full += int(expected.raw.saturated.sum())
            np.testing.assert_array_equal(depth.valid.numpy(), expected.depth.valid.numpy())
            np.testing.assert_array_equal(
                depth.distance_m.numpy(), expected.depth.distance_m.numpy()
            )
            words = ~expected.raw.saturated.numpy()
            np.testing.assert_array_equal(
                depth.amplitude.numpy()[words], expected.depth.amplitude.numpy()[words]
            )
        pair.live.close()
    assert full > 1000


def test_words_arrive_as_they_were_taken(bank_env):
    server, _ = begin_both(bank_env, BRIGHT_US, emulated())
    drive = bank_env.state.drive
    with server:
        camera = client_of(server, 9.0, BRIGHT_US * 1e-6)
        camera.start()
        for step in range(6):
            gray = camera.next_frame()
            frame = drive.frames[:, step]
            assert torch.equal(gray.words, bank_env.problem.bank.gray(frame)[0])
            words, full = samples_of_drive(bank_env.problem, drive, step)
            for shots in Shots:
                found = camera.acquire(shots)
                np.testing.assert_array_equal(found.saturated.numpy(), full[:shots])
                np.testing.assert_array_equal(
                    found.dcs_lsb.numpy(), np.where(full, 0, words)[:shots]
                )
        assert camera.temperature_k() == pytest.approx(303.15)
        camera.close()


def test_the_camera_is_asked_frame_by_frame_and_never_for_what_comes_later(bank_env):
    server, begin = begin_both(bank_env, DARK_US, emulated())
    with server:
        pair = begin()
        assert server.requests == [("gray", 0)]
        assert torch.isnan(pair.live.problem.scenes.features[1:]).all()
        with pytest.raises(ValueError, match=r"frames are \[1\]; expected \[0\]"):
            pair.live.problem.bank.gray(torch.tensor([1]))
        for action in (0, 2, 1):
            pair.step(action)
        pair.live.close()
    assert server.requests == [
        *[("gray", 0), ("frequency", 1), ("samples", 2)],
        # Eight samples are two requests, at two frequencies.
        *[("gray", 1), ("samples", 4), ("frequency", 6), ("samples", 4)],
        *[("gray", 2), ("frequency", 1), ("samples", 4)],
        ("gray", 3),
    ]


def test_a_step_waits_for_the_next_frame(bank_env):
    period_s = 0.5
    server, begin = begin_both(
        bank_env, DARK_US, lambda *a, **k: emulated()(*a, **k, period_s=period_s)
    )
    with server:
        pair = begin()
        began = pair.live.times
        pair.step(0)
        assert pair.live.times.gray_s < pair.live.times.chosen_s <= pair.live.times.samples_s
        assert pair.live.times.samples_s <= pair.live.times.depth_s and began is not pair.live.times
        first = pair.live.times.gray_s
        pair.step(0)
        # A busy machine may be late for a frame, but none comes early.
        assert pair.live.times.gray_s - first > 0.6 * period_s
        pair.live.close()


def test_samples_of_another_instant_are_refused(bank_env):
    server, begin = begin_both(
        bank_env, DARK_US, lambda *a, **k: emulated()(*a, **k, sample_s=0.1), stale_s=0.15
    )
    with server:
        pair = begin()
        with pytest.raises(StaleFrameError, match=r"samples came \d+\.\d+ s after"):
            pair.live.step(0)


def test_a_second_drive_begins_with_the_laser_as_the_first_left_it(bank_env):
    server, begin = begin_both(bank_env, DARK_US, emulated())
    with server:
        pair = begin()
        for _ in range(3):
            pair.step(2)
        left_k = pair.told[1]["temperature_k"]
        _, info = pair.live.reset()
        assert info["temperature_k"] == left_k
        with pytest.raises(ValueError, match="options has 'ambient'; expected some of laser_k"):
            pair.live.reset(options={"ambient": 300.0})
        pair.live.close()


def test_a_laser_about_to_trip_takes_no_samples(bank_env):
    laser = {"ambient_k": [283.15, 293.3], "trip_k": 294.0, "release_k": 293.5}
    server, begin = begin_both(bank_env, DARK_US, emulated(), laser=laser)
    with server:
        live = begin().live
        live.reset(options={"laser_k": 293.999})
        before = len(server.requests)
        _, _, _, _, info = live.step(0)
        assert (info["asked"], info["shots"], info["laser_energy_j"]) == (2, 0, 0.0)
        assert [kind for kind, _ in server.requests[before:]] == ["gray"]
        assert live.times.samples_s == live.times.chosen_s
        live.close()


def test_settings_that_do_not_fit_are_refused(tiny_unwrapper):
    class Server:
        port = 1

    camera = client_of(Server)
    with pytest.raises(ValueError, match=r"offset_lsb is \(24, 31\); expected \(24, 32\)"):
        LiveShotScheduleEnv(camera, unwrapper=tiny_unwrapper, offset_lsb=torch.zeros(24, 31))
    for changes, told in (
        ({"integration_s": 1.5e-6}, "integration_s is 1.5e-06; expected whole microseconds"),
        ({"laser_power_w": 0.0}, "laser_power_w is 0.0; expected watts above 0"),
        ({"integration_s": 0.1}, "integration_s is 0.1; expected whole microseconds"),
        ({"frequencies_hz": (24e6, 11e6)}, "frequencies_hz has 1.1e.07; expected one of"),
    ):
        with pytest.raises(ValueError, match=told):
            client_of(Server, **changes)
