"""One 8-DCS frame of 320 x 240, sensed and decoded, against torch drawing its normal numbers."""

from __future__ import annotations

from time import perf_counter, thread_time

import torch

from benchmarks.rows import row
from benchmarks.turns import alternately
from shotenv.config import SensorConfig, find_config, read_config
from shotenv.sensor import (
    Exposure,
    Purpose,
    acquire,
    draw_offsets,
    incident_light,
    noise_samples,
    sensitivity,
    stream,
)
from unwrap.signal import (
    SAMPLES_PER_FREQUENCY,
    Shots,
    decode,
    demodulation_phase_rad,
    frequency_index,
    unambiguous_range_m,
)

HEIGHT, WIDTH = 240, 320
GOAL = 1.5  # assumed: noise of its own and all else in half as much again
REPEATS = 40


def run() -> list[dict]:
    threads = torch.get_num_threads()
    try:
        return [measured(count) for count in (1, 2)]
    finally:
        torch.set_num_threads(threads)


@torch.inference_mode()
def measured(threads: int) -> dict:
    torch.set_num_threads(threads)
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    exposure = made_up_exposure(sensor)
    # 7 W for 650 us, about the middle of what drives draw.
    per_light = sensitivity(sensor, torch.tensor([7.0]), torch.tensor([6.5e-4]))
    offsets = draw_offsets(sensor, HEIGHT, WIDTH, generator=stream(Purpose.OFFSETS, 0))

    def sense() -> None:
        noise = noise_samples([0], [0], HEIGHT, WIDTH)
        light = incident_light(exposure, per_light)
        raw = acquire(light, sensor, shots=Shots.EIGHT, noise=noise, offsets=offsets)
        for first in (0, SAMPLES_PER_FREQUENCY):
            # As two frames of four: each frequency has a phase of its own.
            decode(raw.dcs_lsb[:, first : first + SAMPLES_PER_FREQUENCY])

    generator, normals = torch.Generator().manual_seed(0), torch.empty(2, HEIGHT, WIDTH)

    def draw() -> None:
        for _ in range(Shots.EIGHT):  # A number for each of a pixel's two taps.
            normals.normal_(generator=generator)

    # The clock of one thread, where there is but one, does not count what else the machine does;
    # what two threads do together is seen on the wall clock alone.
    sense_s, draw_s = alternately(
        sense, draw, REPEATS, thread_time if threads == 1 else perf_counter
    )
    name = f"sensor + decode, 8 DCS / torch's normals, {threads} thread{'s' * (threads > 1)}"
    note = f"{1e3 * sense_s:.2f} ms against {1e3 * draw_s:.2f} ms, {WIDTH} x {HEIGHT}"
    return row(name, sense_s / draw_s, "<=", GOAL, note)


def made_up_exposure(sensor: SensorConfig) -> Exposure:
    """Random distances and daylight: the time depends on neither."""
    random = torch.Generator().manual_seed(0)
    distance_m = 2.0 + 18.0 * torch.rand(1, HEIGHT, WIDTH, generator=random)
    active, ambient = 0.1 / distance_m**2, torch.rand(1, HEIGHT, WIDTH, generator=random)
    ranges_m = [unambiguous_range_m(f_hz) for f_hz in (sensor.f1_hz, sensor.f2_hz)]
    samples = [
        active
        * torch.cos(
            2 * torch.pi * distance_m / ranges_m[frequency_index(k)] - demodulation_phase_rad(k)
        )
        for k in range(Shots.EIGHT)
    ]
    return Exposure(torch.stack(samples, dim=1), active, ambient, distance_m)
