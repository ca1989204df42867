"""Not one bit differs over processes, hash seeds, threads and numbers of environments.

Each process plays 500 steps of every registered environment through auto-resets, in a vector of 1,
2, 7 and 64, all of them drives of the same seeds, and tells a digest of each environment's part.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import torch

import shotenv  # noqa: F401 - registers the environments
from reliability.processes import environment
from reliability.rows import Progress, Row
from reliability.small import tiny_problem

STEPS = 500
SIZES = (1, 2, 7, 64)
PROCESSES = {"PYTHONHASHSEED": ("0", "1", "4294967295"), "threads": (1, 2)}
PROGRAM = "import sys; from reliability.repeatability import tell; tell(*sys.argv[1:])"


def ids() -> list[str]:
    return sorted(name for name in gymnasium.registry if name.startswith("shotenv/"))


def arguments_of(name: str, folder: Path) -> dict[str, object]:
    """Of a tiny bank; held-out families, of which it has no clip, are those of the pocket bank."""
    told = tiny_problem(folder)
    if "Shift" in name:
        return {"bank": "pocket", "frames_per_drive": told["frames_per_drive"]}
    return told


def parts_of(thing: object, row: int, size: int) -> bytes:
    """Bytes of what environment `row` of a vector is told; arrays have the environment first."""
    if isinstance(thing, dict):
        return b"".join(
            key.encode() + parts_of(value, row, size) for key, value in sorted(thing.items())
        )
    array = np.asarray(thing)
    # What a vector tells once for all of them has no axis of environments.
    own = array[row] if array.ndim and len(array) == size else array
    return np.ascontiguousarray(own).tobytes()


def digests_of(name: str, size: int, steps: int, folder: Path) -> list[str]:
    """A digest of each environment of a vector; environment i has the seed 17 + i."""
    env = gymnasium.make_vec(name, num_envs=size, **arguments_of(name, folder))
    made = [hashlib.sha256() for _ in range(size)]
    observation, info = env.reset(seed=[17 + row for row in range(size)])
    told: tuple[object, ...] = (observation, info)
    # By the environment, not by the size of the vector it is in.
    chosen = np.stack([np.random.default_rng(row).integers(0, 3, steps) for row in range(size)], 1)
    for number in range(steps + 1):
        for row, digest in enumerate(made):
            digest.update(b"".join(parts_of(part, row, size) for part in told))
        if number < steps:
            told = env.step(chosen[number])
    env.close()
    return [digest.hexdigest() for digest in made]


def tell(folder: str, threads: str, steps: str) -> None:
    """Print digests by environment and size, as JSON; run in a process of its own."""
    torch.set_num_threads(int(threads))
    found = {
        name: {size: digests_of(name, size, int(steps), Path(folder)) for size in SIZES}
        for name in ids()
    }
    print(json.dumps(found))


def told_by(words: list[str], variables: dict[str, str]) -> object:
    """What a process prints, as JSON."""
    done = subprocess.run(words, env=variables, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return json.loads(done.stdout)


def measure(progress: Progress) -> list[Row]:
    begun, steps, told = time.perf_counter(), progress.size(STEPS, 40), []
    settings = [(h, t) for h in PROCESSES["PYTHONHASHSEED"] for t in PROCESSES["threads"]]
    settings = settings[: progress.size(len(settings), 2)]
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        tiny_problem(place)
        for number, (hash_seed, threads) in enumerate(settings):
            # Each predicts for itself: nothing is read that another has computed.
            variables = environment(place / f"cache{number}", PYTHONHASHSEED=str(hash_seed))
            words = [sys.executable, "-c", PROGRAM, folder, str(threads), str(steps)]
            name = f"hash seed {hash_seed}, {threads} threads"
            told.append(progress.part(name, partial(told_by, words, variables)))
            progress(f"process {number + 1} of {len(settings)}")
    between = sum(
        one[name][size] != told[0][name][size] for one in told for name in one for size in one[name]
    )
    # Environment i is the same whatever else is in the vector.
    across = sum(
        one[name][size][row] != one[name][str(max(SIZES))][row]
        for one in told
        for name in one
        for size in one[name]
        for row in range(int(size))
    )
    seconds = time.perf_counter() - begun
    what = f"{len(told[0])} environments, {steps} steps through auto-resets"
    return [
        Row(
            2,
            f"{what}, in {len(settings)} fresh processes with 3 hash seeds, 1 and 2 threads",
            {"differing digests": between, "compared": len(told) * len(told[0]) * len(SIZES)},
            between == 0,
            seconds,
        ),
        Row(
            2,
            f"{what}: each in vectors of {', '.join(map(str, SIZES))}",
            {
                "differing digests": across,
                "compared": len(told) * len(told[0]) * sum(SIZES),
            },
            across == 0,
            seconds,
        ),
    ]
