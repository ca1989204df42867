"""A million steps and a hundred thousand rendered frames grow no memory and get no slower.

Steps are those of the pocket bank, by the single environment and by a vector of 16, in processes of
their own; what the first tenth takes of memory is its warm-up. Frames are as small as cameras can
be, rendered by two workers: what is looked at is the parent, which stays as long as the bank takes.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import gymnasium
import numpy as np
import torch

import shotenv  # noqa: F401 - registers the environments
from reliability.processes import SHOTENV, descriptors, environment, memory_mb, started
from reliability.rows import Progress, Row
from reliability.small import write_small_bank_config

STEPS, FRAMES, VECTOR = 1_000_000, 100_000, 16
MOST_MB, MOST_PARENT_MB = 10.0, 50.0
SLOWER = 1.15
"""Median step of the last tenth over that of the first, each beside other work of its time; a
machine that others use is not steadier (assumed)."""
PARTS = 20
WEIGHED, WEIGHED_EVERY = torch.arange(32.0), 50
"""What other work is done with, and every how manieth step."""
FRAMES_PER_CLIP = 500
PROGRAM = "import sys; from reliability.long_runs import walk; walk(int(sys.argv[1]), sys.argv[2])"


def yardstick_s() -> float:
    """Processor time of a piece of work that is always the same, of small tensors as steps are.

    A machine that others use is slower at some times than at others, at both alike.
    """
    begun = time.process_time()
    for _ in range(20):
        torch.stack([WEIGHED] * 4).index_select(0, torch.tensor([2, 0])).sum().numpy()
    return time.process_time() - begun


def walk(steps: int, kind: str) -> None:
    """Play that many steps in all and print what memory and time were; in a process of its own."""
    torch.set_num_threads(1)
    name, size = "shotenv/ShotSchedule-v0", 1 if kind == "single" else VECTOR
    env = gymnasium.make(name) if size == 1 else gymnasium.make_vec(name, num_envs=size)
    random = np.random.default_rng(0)
    env.reset(seed=0)
    memory, seconds, yardsticks, files = [], [], [], []
    for _ in range(PARTS):
        taken, others = [], []
        for chosen in random.integers(0, 3, (steps // PARTS // size, size)):
            # Of the processor: how much of it others leave is nothing that a step does.
            begun = time.process_time()
            _, _, terminated, truncated, _ = env.step(chosen if size > 1 else chosen[0])
            taken.append(time.process_time() - begun)
            if len(taken) % WEIGHED_EVERY == 0:
                others.append(yardstick_s())
            if size == 1 and (terminated or truncated):
                env.reset()
        memory.append(memory_mb())
        seconds.append(statistics.median(taken))
        yardsticks.append(statistics.median(others))
        files.append(descriptors())
    print(
        json.dumps({"memory": memory, "seconds": seconds, "yardsticks": yardsticks, "files": files})
    )


def of_steps(kind: str, steps: int, cache: Path) -> Row:
    begun = time.perf_counter()
    words = [sys.executable, "-c", PROGRAM, str(steps), kind]
    done = subprocess.run(words, env=environment(cache), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    told = json.loads(done.stdout)
    # Twenty parts: two are a tenth. Highest afterwards over the end of the warm-up.
    memory, seconds, tenth = told["memory"], told["seconds"], PARTS // 10
    growth_mb = max(memory[tenth:]) - memory[tenth - 1]
    weighed = [own / other for own, other in zip(seconds, told["yardsticks"], strict=True)]
    drift = statistics.mean(weighed[-tenth:]) / statistics.mean(weighed[:tenth])
    more = told["files"][-1] - told["files"][0]
    return Row(
        9,
        f"{steps} steps, {kind} environment" + ("" if kind == "single" else f" of {VECTOR}"),
        {
            "growth after the first tenth, MB": round(growth_mb, 2),
            "memory by twentieths, MB": [round(value, 1) for value in memory],
            "new file descriptors": more,
            "median step beside other work, last tenth over first": round(drift, 3),
            "median step, us of the processor": round(1e6 * statistics.median(seconds), 1),
        },
        growth_mb <= MOST_MB and more <= 0 and drift <= SLOWER,
        time.perf_counter() - begun,
    )


def of_frames(frames: int, place: Path, progress: Progress) -> Row:
    begun = time.perf_counter()
    per_clip = min(FRAMES_PER_CLIP, frames // 4)
    small = write_small_bank_config(
        place,
        camera={"width": 16, "height": 16, "samples_per_pixel": 1, "gray_instants": 1},
        world={"frames_per_clip": per_clip, "families": ["garage"]},
        **{"train_clips": frames // per_clip, "validation_clips": 0, "test_clips": 0},
    )
    log = place / "render.txt"
    words = [*SHOTENV, "render", "--config", small, "--workers", 2, "--out", place / "bank"]
    process = started(words, environment(place / "cache", OMP_NUM_THREADS="1"), log)
    memory, files = [], []
    while process.poll() is None:
        # From the first clip on: what comes before is starting.
        if any((place / "bank" / "clips").glob("[0-9]*")):
            try:
                memory.append(memory_mb(process.pid))
                files.append(descriptors(process.pid))
            except (OSError, ValueError):  # It has just ended.
                break
            if len(memory) % 60 == 0:
                clips = len(list((place / "bank" / "clips").glob("[0-9]*")))
                progress(f"{clips * per_clip} of {frames} frames, {memory[-1]:.1f} MB")
        time.sleep(1.0)
    if process.wait():
        raise RuntimeError(log.read_text()[-2000:])
    growth_mb, more = max(memory) - memory[0], files[-1] - files[0]
    curve = [memory[len(memory) * part // PARTS] for part in range(PARTS)]
    return Row(
        9,
        f"{frames} frames of 16 x 16 pixels rendered, {per_clip} a clip, 2 workers",
        {
            "growth of the parent, MB": round(growth_mb, 2),
            "memory by twentieths, MB": [round(value, 1) for value in curve],
            # A worker that is being replaced is a descriptor more for a moment.
            "new file descriptors": more,
        },
        growth_mb <= MOST_PARENT_MB and more <= 1,
        time.perf_counter() - begun,
    )


def measure(progress: Progress) -> list[Row]:
    steps, frames = progress.size(STEPS, 20_000), progress.size(FRAMES, 200)
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        kinds: dict[str, Callable[[], Row]] = {
            "steps of the single environment": lambda: of_steps("single", steps, place / "cache"),
            "steps of a vector": lambda: of_steps("vector", steps, place / "cache"),
            "rendered frames": lambda: of_frames(frames, place, progress),
        }
        return [progress.row(9, name, make) for name, make in kinds.items()]
