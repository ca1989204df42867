"""A bank rendered on a Ray of two machines, one of which dies, is byte for byte the local one."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys

import pytest
from watched_processes import wait_until

from shotenv.bank.build import build_bank
from shotenv.config.bank import BankConfig
from shotenv.config.reader import find_config, merged, read_config
from shotenv.config.sensor import SensorConfig

pytestmark = [pytest.mark.render, pytest.mark.slow]
PROGRAM = """
import sys
from pathlib import Path
from shotenv.bank.build import build_bank
from shotenv.config import BankConfig
config = BankConfig.model_validate_json(sys.argv[1])
build_bank(config, Path(sys.argv[2]), workers=2, executor="ray")
"""


@pytest.fixture(scope="module")
def config() -> BankConfig:
    """Ten clips of two frames: 32 x 24 pixels, one ray each per instant."""
    sensor = read_config(SensorConfig, find_config("sensor", "epc660"))
    return merged(
        BankConfig(name="small", sensor=sensor),
        {
            "camera": {"width": 32, "height": 24, "samples_per_pixel": 1, "gray_instants": 1},
            "world": {"frames_per_clip": 2, "families": ["garage", "sunny_road"]},
            **{"seed": 5, "train_clips": 3, "validation_clips": 1, "test_clips": 1},
        },
    )


@pytest.fixture
def cluster():
    """Two machines of a core each, as far as Ray can tell."""
    from ray.cluster_utils import Cluster

    made = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        made.add_node(num_cpus=1)
        yield made
    finally:
        made.shutdown()


def standing(folder) -> int:
    return len(list(folder.glob("clips/*/clip.json")))


def digests(folder) -> dict[str, str]:
    """SHA-256 of every file, hidden ones too, but for the lock."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != ".lock"
    }


@pytest.mark.timeout(600)
def test_a_bank_is_the_same_though_a_machine_dies(config, cluster, tmp_path):
    folder = tmp_path / "ray"
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, config.model_dump_json(), str(folder)],
        env=os.environ | {"RAY_ADDRESS": cluster.address},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        wait_until(lambda: standing(folder) >= 2 or process.poll() is not None, seconds=120)
        (other,) = cluster.worker_nodes
        cluster.remove_node(other, allow_graceful=False)
        at_death = standing(folder)
        told, _ = process.communicate(timeout=200)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0, told
    assert at_death < standing(folder), "died too late to prove it"
    assert digests(folder) == digests(build_bank(config, tmp_path / "local", workers=2))
