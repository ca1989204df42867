"""One environment step against the least it could do: its normals and one atan2 over its pixels."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch

from benchmarks.rows import row
from benchmarks.turns import alternately
from shotenv.bank.files.store import write_clip, write_manifest
from shotenv.config import env_config
from shotenv.decision import open_problem, reset, step
from shotenv.env import ShotScheduleVectorEnv
from unwrap.networks import TofRegNet, save_weights
from unwrap.signal import Shots

HEIGHT, WIDTH, FRAMES = 120, 160, 16
REPEATS = 100
DRIVES = 16
NEVER_TRIPS = {"laser": {"trip_k": 450.0, "release_k": 449.0}}
"""A tripped laser takes no samples: with this one every timed step does the whole work."""
GOAL, VECTOR_GOAL = 3.0, 1.0
"""Assumed: a step beside the least that it must do; a vector beside its drives one by one."""


def run() -> list[dict]:
    threads, cache = torch.get_num_threads(), os.environ.get("SHOTENV_CACHE")
    # On one, since `alternately` reads the clock of this thread alone.
    torch.set_num_threads(1)
    try:
        with tempfile.TemporaryDirectory() as folder:
            # The network's predictions for the made-up bank are of no use to anyone else.
            os.environ["SHOTENV_CACHE"] = folder
            fields = write_problem(Path(folder))
            return [*(single(fields, shots) for shots in Shots), *batched(fields)]
    finally:
        torch.set_num_threads(threads)
        if cache is None:
            del os.environ["SHOTENV_CACHE"]
        else:
            os.environ["SHOTENV_CACHE"] = cache


def write_problem(folder: Path) -> dict[str, object]:
    """A bank of random light and an untrained network: the step's time depends on neither."""
    random = np.random.default_rng(0)
    shape = (FRAMES, HEIGHT, WIDTH)
    distance = random.uniform(2, 20, shape).astype(np.float32)
    active = 0.1 / distance**2
    # All eight at one frequency: what the light is worth does not matter here.
    phase = 4 * math.pi * 24e6 / 299_792_458 * distance
    turns = [math.pi / 2 * k for k in range(Shots.EIGHT)]
    arrays = {
        "correlation": np.stack([active * np.cos(phase - turn) for turn in turns], 1),
        "active": active,
        "ambient": random.uniform(0, 1, shape),
        "distance_m": distance,
    }
    arrays = {name: values.astype(np.float32) for name, values in arrays.items()}
    arrays["gray"] = random.integers(0, 4096, shape).astype(np.uint16)
    numbers = [0.001] * FRAMES
    per_frame = ("time_s", "ego_speed_m_s", "yaw_rate_rad_s", "gray_exposure_s")
    metadata = {"name": "noise", "family": "garage", "seed": 0, "split": "train"}
    record = write_clip(
        folder / "bank/clips/noise", arrays, metadata | dict.fromkeys(per_frame, numbers)
    )
    write_manifest(folder / "bank", "bench", [record], (HEIGHT, WIDTH))
    network = {"network": "tofregnet", "width": 4, "range_m": 30.0, "f1_hz": 24e6}
    save_weights(folder / "net.safetensors", TofRegNet(4, 30.0), network)
    return {
        "bank": str(folder / "bank"),
        "unwrapper": str(folder / "net.safetensors"),
        # More than are ever timed: no step begins a new drive.
        "frames_per_drive": 10_000,
    }


def single(fields: dict[str, object], shots: Shots) -> dict:
    problem = open_problem(env_config(**fields, **NEVER_TRIPS))
    state = {"now": reset(problem, [0])}
    action = torch.tensor([shots.action])
    pixels = torch.randn(2, HEIGHT, WIDTH)

    def play() -> None:
        state["now"], _ = step(problem, state["now"], action)

    step_s, least_s = alternately(play, lambda: least([shots], pixels), REPEATS)
    note = f"{1e3 * step_s:.2f} ms against {1e3 * least_s:.2f} ms, {WIDTH} x {HEIGHT}, one thread"
    return row(f"step, {int(shots)} DCS / normals + atan2", step_s / least_s, "<=", GOAL, note)


def least(acquisitions: Sequence[Shots], pixels: torch.Tensor) -> None:
    """Draw the normals of each acquisition as torch does, and take one atan2 over its pixels."""
    # Torch's and not this project's, which may become faster without making a step dearer.
    normals, generator = torch.empty(2, HEIGHT, WIDTH), torch.Generator().manual_seed(0)
    for shots in acquisitions:
        # Of two samples the reward's reference needs two more.
        drawn = max(shots, Shots.FOUR)
        for _ in range(drawn):
            normals.normal_(generator=generator)
        torch.atan2(pixels[0], pixels[1])


def batched(fields: dict[str, object]) -> list[dict]:
    """A vector of drives against the same drives one by one, and against the least of all."""
    fields = {**fields, **NEVER_TRIPS}
    one = ShotScheduleVectorEnv(1, **fields)
    many = ShotScheduleVectorEnv(DRIVES, **fields)
    one.reset(seed=0)
    many.reset(seed=0)
    actions = np.arange(DRIVES) % len(Shots)

    def singly() -> None:
        for action in actions:
            one.step(np.array([action]))

    def together() -> None:
        many.step(actions)

    # Fewer turns: each takes the time of sixteen steps.
    many_s, one_s = alternately(together, singly, REPEATS // 10)
    note = f"{1e3 * many_s / DRIVES:.2f} ms per step against {1e3 * one_s / DRIVES:.2f} ms"
    name = f"vector of {DRIVES} / {DRIVES} single steps"
    singles = row(name, many_s / one_s, "<=", VECTOR_GOAL, note)
    taken, pixels = [tuple(Shots)[action] for action in actions], torch.randn(2, HEIGHT, WIDTH)
    many_s, least_s = alternately(together, lambda: least(taken, pixels), REPEATS // 10)
    note = f"{1e3 * many_s / DRIVES:.2f} ms per step against {1e3 * least_s / DRIVES:.2f} ms"
    name = f"vector of {DRIVES}, 2, 4 and 8 DCS / normals + atan2"
    return [singles, row(name, many_s / least_s, "<=", GOAL, note)]
