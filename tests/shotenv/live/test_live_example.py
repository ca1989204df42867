"""The example that users run: a street that is as far as it says, and the loop over the socket."""

from __future__ import annotations

import re

import numpy as np
import torch
from served_drives import client_of, example_module

from shotenv.config import env_config
from shotenv.sensor import description_of
from unwrap.depth import correct
from unwrap.signal import RawFrame, Shots

SIZE = (24, 32)


def example():
    example_module("emulated_camera")  # Which lies beside it.
    return example_module("live")


def test_the_street_is_as_far_as_its_light_says():
    live, sensor = example(), env_config().sensor
    frames, _ = live.street(sensor, 3, SIZE, 0.1)
    with example_module("emulated_camera").EmulatedCamera(frames) as server:
        camera = client_of(server, live.LASER_POWER_W, live.INTEGRATION_S)
        camera.start()
        for number in range(3):
            camera.next_frame()
            taken = camera.acquire(Shots.EIGHT)
            raw = RawFrame(taken.dcs_lsb[None], taken.saturated.any(dim=0)[None])
            depth = correct(raw, None, description_of(sensor), eight="two_frequency")
            true_m = live.light_at(sensor, live.rays(SIZE), 0.1 * number).distance_m
            error_m = (depth.distance_m - true_m).abs()[depth.valid]
            # Some pixels see two things within a frame, at the edges of what moves.
            assert depth.valid.float().mean() > 0.15 and error_m.median() < 0.1
        camera.close()


def test_what_comes_nearer_does_so_at_the_street_s_speed():
    live = example()
    ahead = live.rays(SIZE)[2]
    before, after = (live.seen(live.rays(SIZE), time_s)[0] for time_s in (0.0, 0.1))
    # On the front of the tunnel, straight ahead.
    front = np.abs(before * ahead - (live.TUNNEL_M[0] - 0.3)) < 0.01
    assert front.any()
    nearer_m = (before[front] - after[front]) * ahead[front]
    np.testing.assert_allclose(nearer_m, 0.1 * live.SPEED_M_S, atol=1e-6)


def test_the_example_tells_stages_rate_and_energy():
    torch.manual_seed(0)
    live = example()
    told = live.main(live.rule(), 4, SIZE, real_time=False)
    stages = re.findall(r"^(.+?) +(\d+\.\d) ms +(\d+\.\d) ms$", told, re.MULTILINE)
    assert [name for name, *_ in stages] == [
        "gray received -> shots chosen",
        "shots chosen -> samples received",
        "samples received -> depth",
        "gray received -> depth",
    ]
    assert all(float(median) <= float(high) for _, median, high in stages)
    frames = re.findall(r"(\d) samples: (\d+)", told)
    assert sum(int(count) for _, count in frames) == 4
    (energy,) = re.findall(r"^energy (\d+) % of that of 8 samples", told, re.MULTILINE)
    (rate,) = re.findall(r"^4 frames at (\d+\.\d+) Hz, \d+ later", told, re.MULTILINE)
    assert 20 < int(energy) <= 100 and float(rate) > 0
