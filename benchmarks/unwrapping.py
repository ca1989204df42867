"""The vote of neighbours over eight samples: compiled, against the chain of torch operations."""

from __future__ import annotations

from time import thread_time

import torch

from benchmarks.rows import row
from benchmarks.turns import alternately
from unwrap.depth.kernel_density import (
    KernelDensity,
    density_by_torch,
    kernel_density,
    unwrap_kernel_density,
)
from unwrap.depth.mismatch import hypotheses
from unwrap.signal import RawFrame, SensorDescription, decode_at

HEIGHT, WIDTH = 120, 160
GOAL = 0.1  # assumed: a tenth of the sum over neighbours
REPEATS, FRAMES = 7, 20


def run() -> list[dict]:
    threads = torch.get_num_threads()
    try:
        torch.set_num_threads(1)
        return [measured()]
    finally:
        torch.set_num_threads(threads)


@torch.inference_mode()
def measured() -> dict:
    """Pixels of noise, whose hypotheses all have a weight: the most work that there is."""
    random = torch.Generator().manual_seed(0)
    dcs_lsb = (20 * torch.randn(1, 8, HEIGHT, WIDTH, generator=random)).round()
    raw = RawFrame(dcs_lsb, torch.zeros(1, HEIGHT, WIDTH, dtype=torch.bool))
    sensor, parameters = SensorDescription(noise_lsb=20.0), KernelDensity()
    frames = [decode_at(i, raw, sensor) for i in (0, 1)]
    model = parameters.mismatch_model((sensor.f1_hz, sensor.f2_hz), sensor.max_range_m)
    depth_m, weight = hypotheses(frames, 20.0, model, parameters.hypotheses)

    def vote() -> None:
        kernel_density(depth_m, weight, parameters)

    def reference() -> None:
        density_by_torch(depth_m, weight, parameters)

    vote()  # Compiled, or loaded.
    loop_s, torch_s = alternately(vote, reference, REPEATS)
    unwrap_kernel_density(raw, sensor)
    frame_s = float("inf")
    for _ in range(FRAMES):
        start = thread_time()
        unwrap_kernel_density(raw, sensor)
        frame_s = min(frame_s, thread_time() - start)
    note = (
        f"{1e3 * loop_s:.2f} ms against {1e3 * torch_s:.1f} ms; {1e3 * frame_s:.2f} ms for the "
        f"whole of a frame at best, {WIDTH} x {HEIGHT}, one thread"
    )
    return row("kernel density, compiled / torch", loop_s / torch_s, "<=", GOAL, note)
