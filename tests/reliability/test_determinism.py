"""Same seed, same numbers: across environments, processes, hash seeds, threads and batches."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch
from variants import kwargs_of

import shotenv  # noqa: F401 - registers the environments
from shotenv.sensor.acquisition import expose
from shotenv.sensor.exposure import Exposure
from shotenv.sensor.noise import draw_noise
from unwrap.signal.decoding import decode
from unwrap.signal.shots import Shots
from unwrap.support.process_state import torch_threads

IDS = sorted(name for name in gymnasium.registry if name.startswith("shotenv/"))
STEPS = 500
PROGRAM = """
import json, sys, torch
torch.set_num_threads(int(sys.argv[2]))
sys.path[:0] = [sys.argv[3], sys.argv[3] + "/../helpers"]
from test_determinism import played
print(json.dumps(played(json.loads(sys.argv[1]))))
"""


def played(kwargs) -> list[str]:
    """A line for each part of what a vector of two tells, in some steps through an auto-reset.

    One by one, and not one sum over all, so that a difference names the step and the part.
    """
    lines = []
    for env_id in IDS:
        env = gymnasium.make_vec(env_id, num_envs=2, **kwargs_of(env_id, kwargs))
        told: list[tuple[str, object]] = [
            ("predicted", env.unwrapped.problem.kept.distance_m.numpy()),
            ("reset", env.reset(seed=17)),
        ]
        for number, chosen in enumerate(np.random.default_rng(0).integers(0, 3, (34, 2))):
            names = "observation", "reward", "terminated", "truncated", "info"
            for name, part in zip(names, env.step(chosen), strict=True):
                told.append((f"{number} {name}", part))
        lines += [f"{env_id} {name}: {sha256_of(part)}" for name, part in told]
    return lines


def sha256_of(thing) -> str:
    """Of an array, or of all that a dictionary or tuple holds."""
    if isinstance(thing, dict):
        return sha256_of([f"{key} {sha256_of(part)}" for key, part in sorted(thing.items())])
    if isinstance(thing, tuple):
        return sha256_of([sha256_of(part) for part in thing])
    return hashlib.sha256(np.ascontiguousarray(thing).tobytes()).hexdigest()


@pytest.mark.parametrize("env_id", IDS)
def test_two_environments_agree_over_500_steps_and_resets(tiny_kwargs, env_id):
    twins = [gymnasium.make(env_id, **kwargs_of(env_id, tiny_kwargs)) for _ in range(2)]
    assert len({sha256_of(twin.reset(seed=3)) for twin in twins}) == 1
    for action in np.random.default_rng(5).integers(0, 3, STEPS):
        left, right = (twin.step(action) for twin in twins)
        assert sha256_of(left) == sha256_of(right)
        if left[3]:
            assert len({sha256_of(twin.reset()) for twin in twins}) == 1


# The everyday run starts one process, whose threads differ from this one's on most machines.
@pytest.mark.parametrize(
    "settings",
    [[("1", "1")], pytest.param([("1", "1"), ("2", "2")], marks=pytest.mark.slow)],
    ids=["one", "two"],
)
def test_fresh_processes_agree_whatever_hash_seed_and_threads(tiny_kwargs, tmp_path, settings):
    here = str(Path(__file__).parent)
    # First, and alone: it compiles the loops, which the other processes then find on disk.
    expected = played(tiny_kwargs)
    started = []
    for hash_seed, threads in settings:
        # Each predicts for itself, too: with the session's cache they would read what this process
        # has predicted, and not find out whether their threads matter.
        cache = str(tmp_path / f"cache{threads}")
        process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM, json.dumps(tiny_kwargs), threads, here],
            env={**os.environ, "PYTHONHASHSEED": hash_seed, "SHOTENV_CACHE": cache},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        started.append(process)
    # Both are waited for before anything is judged, so that none outlives a failed test.
    ended = [(*process.communicate(), process.returncode) for process in started]
    for output, errors, status in ended:
        assert status == 0, errors
        assert json.loads(output) == expected


def test_large_frames_do_not_depend_on_threads_or_batch(sensor):
    """At 320 x 240 torch splits maps among threads; not a bit may depend on where it cuts."""
    generator = torch.Generator().manual_seed(2)
    unit = torch.rand(3, 11, 240, 320, generator=generator)
    exposure = Exposure(
        0.01 * unit[:, :8] - 0.005, 0.01 + 0.01 * unit[:, 8], unit[:, 9], unit[:, 10]
    )
    noise = torch.stack([draw_noise(seed, 0, 4, 240, 320) for seed in range(3)])
    one = torch.ones(3, dtype=torch.float64)

    def found(rows: slice) -> tuple[torch.Tensor, ...]:
        raw = expose(
            exposure[rows],
            sensor,
            shots=Shots.FOUR,
            laser_power_w=7.0 * one[rows],
            integration_s=6e-4 * one[rows],
            noise=noise[rows],
            offsets=None,
        )
        phase = decode(raw.dcs_lsb)
        return raw.dcs_lsb, phase.phase_rad, phase.amplitude

    results = []
    for count in (1, 2):
        with torch_threads(count):
            results.append(found(slice(0, 3)))
            singles = [found(slice(row, row + 1)) for row in range(3)]
        results.append(tuple(torch.cat(parts) for parts in zip(*singles, strict=True)))
    for result in results[1:]:
        assert all(torch.equal(a, b) for a, b in zip(results[0], result, strict=True))
