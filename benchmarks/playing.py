"""Frames played a second: a thinned bank against every pixel, one process against many, and PPO."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AsyncVectorEnv, AutoresetMode
from stable_baselines3.common.vec_env import SubprocVecEnv

from benchmarks.rows import row
from benchmarks.stepping import NEVER_TRIPS, write_problem
from benchmarks.turns import alternately
from shotenv import ENV_ID
from shotenv.env import ShotScheduleVectorEnv

DRIVES, MANY = 64, 512
STEPS = 60
"""Steps of a vector in each turn."""
PPO_FRAMES = 65_536
POCKET_GOAL, FLAT_GOAL, PROCESSES_GOAL, PPO_GOAL = 25.0, 1.2, 5.0, 0.5
"""Times as fast as every pixel; cost of a drive among many over that among some; times as fast as
a process for each core; share of the bare environment's pace that learning leaves (assumed)."""


def run() -> list[dict]:
    cache = os.environ.get("SHOTENV_CACHE")
    try:
        with tempfile.TemporaryDirectory() as folder:
            # The network's predictions for the made-up bank are of no use to anyone else.
            os.environ["SHOTENV_CACHE"] = folder
            return [every_pixel(Path(folder)), flat(), *processes(), ppo()]
    finally:
        if cache is None:
            del os.environ["SHOTENV_CACHE"]
        else:
            os.environ["SHOTENV_CACHE"] = cache


def player(envs: ShotScheduleVectorEnv, steps: int) -> Callable[[], None]:
    """Plays random actions, resets of drives included."""
    random = np.random.default_rng(0)
    actions = random.integers(0, 3, (997, envs.num_envs))
    envs.reset(seed=0)
    place = iter(range(10**9))

    def play() -> None:
        for _ in range(steps):
            envs.step(actions[next(place) % len(actions)])

    return play


def every_pixel(folder: Path) -> dict:
    fields = {**write_problem(folder), **NEVER_TRIPS}
    pocket = player(ShotScheduleVectorEnv(DRIVES), STEPS)
    whole = player(ShotScheduleVectorEnv(DRIVES, **fields), 2)
    before = torch.get_num_threads()
    # On one thread's own time: torch's threads would wait for each other over the larger maps
    # where other processes run, and flatter the pocket.
    torch.set_num_threads(1)
    try:
        pocket_s, whole_s = alternately(pocket, whole, 5)
    finally:
        torch.set_num_threads(before)
    pace, whole_pace = DRIVES * STEPS / pocket_s, DRIVES * 2 / whole_s
    note = f"{pace:.0f} frames a second against {whole_pace:.0f}, one thread"
    return row(
        f"vector of {DRIVES}, pocket / every pixel", pace / whole_pace, ">=", POCKET_GOAL, note
    )


def flat() -> dict:
    some = player(ShotScheduleVectorEnv(DRIVES), STEPS)
    many = player(ShotScheduleVectorEnv(MANY), STEPS // 4)
    many_s, some_s = alternately(many, some, 7, perf_counter, settled=True)
    each_many, each_some = many_s / (MANY * (STEPS // 4)), some_s / (DRIVES * STEPS)
    note = f"{1e6 * each_many:.1f} us a frame against {1e6 * each_some:.1f}; {threads()}"
    name = f"a frame in a vector of {MANY} / of {DRIVES}"
    return row(name, each_many / each_some, "<=", FLAT_GOAL, note)


def processes() -> list[dict]:
    """The native vector against a process of a single environment for each core."""
    cores = len(os.sched_getaffinity(0))
    # More processes than cores would only wait for each other.
    count = max(cores, 2)
    native = player(ShotScheduleVectorEnv(DRIVES), STEPS)
    rows = []
    actions = np.random.default_rng(0).integers(0, 3, (997, count))
    # Processes that are spawned have not imported `shotenv`; the name makes gymnasium do it.
    makers = [lambda: gymnasium.make(f"shotenv:{ENV_ID}")] * count
    for name, make in (
        ("SubprocVecEnv", lambda: SubprocVecEnv(makers, start_method="spawn")),
        (
            "AsyncVectorEnv",
            lambda: AsyncVectorEnv(makers, context="spawn", autoreset_mode=AutoresetMode.NEXT_STEP),
        ),
    ):
        envs = make()
        envs.reset()

        def play(envs=envs) -> None:
            for one in actions[:STEPS]:
                envs.step(one)

        native_s, other_s = alternately(native, play, 5, perf_counter, settled=True)
        envs.close()
        pace, other_pace = DRIVES * STEPS / native_s, count * STEPS / other_s
        note = f"{pace:.0f} frames a second against {other_pace:.0f} of {count} processes"
        rows.append(row(f"native vector / {name}", pace / other_pace, ">=", PROCESSES_GOAL, note))
    return rows


def ppo() -> dict:
    """The one-file example against the environment that it learns from, random actions."""
    path = Path(__file__).parent.parent / "examples" / "one_file_ppo.py"
    spec = importlib.util.spec_from_file_location("one_file_ppo", path)
    assert spec and spec.loader
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    before = torch.get_num_threads()
    # As the example's own `main` does.
    torch.set_num_threads(1)
    try:
        config = example.Config(steps=PPO_FRAMES)
        bare = player(
            ShotScheduleVectorEnv(config.envs, autoreset_mode="SameStep"),
            PPO_FRAMES // config.envs,
        )

        def learn() -> None:
            with contextlib.redirect_stdout(io.StringIO()):
                example.train(config)

        bare_s, learned_s = alternately(bare, learn, 3, perf_counter)
    finally:
        torch.set_num_threads(before)
    pace, bare_pace = PPO_FRAMES / learned_s, PPO_FRAMES / bare_s
    note = f"{pace:.0f} frames a second against {bare_pace:.0f}, one thread"
    return row("one-file PPO / its bare environment", bare_s / learned_s, ">=", PPO_GOAL, note)


def threads() -> str:
    return f"{torch.get_num_threads()} threads"
