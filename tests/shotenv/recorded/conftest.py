"""A simulated drive, recorded, and the folder that a bank is imported from."""

from __future__ import annotations

import pytest
from word_banks import record, write_folder

from agents.cli.camera_commands import read_camera
from shotenv.config.keywords import env_config
from shotenv.config.reader import find_config
from shotenv.decision.problem import open_problem
from shotenv.recorded.bank_import import import_bank

SEEDS = (5, 2**61 + 7)


@pytest.fixture(scope="session")
def simulated(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return open_problem(env_config(**{**tiny_kwargs, "frames_per_drive": 12}, split="test"))


@pytest.fixture(scope="session")
def drives(simulated):
    return [record(simulated, seed) for seed in SEEDS]


@pytest.fixture(scope="session")
def folder(drives, tmp_path_factory):
    return write_folder(tmp_path_factory.mktemp("recordings") / "bench", drives)


@pytest.fixture(scope="session")
def take_in():
    """Import a folder as the command does."""

    def imported(folder, out, sensor="epc660", **kind):
        camera, _ = read_camera(str(folder / "camera" / "bench.yaml"))
        return import_bank(folder, camera, find_config("sensor", sensor), out, **kind)

    return imported


@pytest.fixture(scope="session")
def bank(folder, take_in, tmp_path_factory):
    return take_in(folder, tmp_path_factory.mktemp("banks") / "bench")
