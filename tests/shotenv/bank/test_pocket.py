"""The bank that ships: what it holds, whom it fits, that it plays alone and is the same problem."""

from __future__ import annotations

import dataclasses
import math
import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
import torch

from agents.optimum.tabulation import tabulate
from shotenv.bank.opening import find_thinned, open_bank
from shotenv.bank.thinned import ThinnedBank
from shotenv.config.keywords import env_config
from shotenv.decision.problem import open_problem


def test_the_bank_that_ships_is_found_by_name_alone():
    pocket = open_bank("pocket", render=False)
    assert isinstance(pocket, ThinnedBank) and pocket.name == "pocket" and pocket.every == 10
    assert len(pocket) >= 3000 and len(pocket.clips) >= 100
    assert len(pocket.splits("test")) >= 25
    for split in ("train", "validation", "test", "shift", "all"):
        assert pocket.splits(split)
    assert {stored.name for stored in pocket.manifest.networks} == {"tofregnet", "tofsegnet"}
    assert sum(path.stat().st_size for path in pocket.folder.iterdir()) <= 25e6
    assert find_thinned("starter") is None and find_thinned("/pocket") is None


@pytest.mark.parametrize("unwrapper", ["tofregnet", "tofsegnet"])
def test_the_bank_that_ships_fits_the_shipped_networks_and_features(unwrapper):
    """Else it must be thinned again: docs/bank.md says how."""
    config = env_config(bank="pocket", unwrapper=unwrapper, split="test")
    problem = open_problem(config)
    frames = problem.bank.frames("test")
    assert torch.isfinite(problem.scenes.features[frames]).all()
    assert torch.isfinite(problem.scenes.log_ambient[frames]).all()
    distance_m = problem.kept.distance_of(frames)
    assert distance_m.min() >= 0 and 1.0 < distance_m.mean() < 25.0


PLAY = """
import sys
sys.modules["mitsuba"] = sys.modules["drjit"] = sys.modules["trimesh"] = None
import gymnasium, shotenv
from unwrap.networks import predictor
def refuse(*_): raise AssertionError("a network was loaded")
predictor.load_weights = refuse
env = gymnasium.make("shotenv/ShotSchedule-v0", bank="pocket")
env.reset(seed=1)
env.action_space.seed(1)
total = 0.0
for _ in range(20):
    _, reward, *_ = env.step(env.action_space.sample())
    total += reward
print(repr(float(total)))
"""


def test_the_bank_that_ships_plays_without_renderer_networks_or_cache(tmp_path):
    cache = tmp_path / "cache"
    environment = {**os.environ, "SHOTENV_CACHE": str(cache)}
    found = [
        subprocess.run(
            [sys.executable, "-c", PLAY],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for _ in range(2)
    ]
    assert found[0] == found[1] and math.isfinite(float(found[0]))
    assert not cache.exists()


def agreement():
    """The script docs/pocket_agreement.py."""
    path = Path(__file__).parents[3] / "docs" / "pocket_agreement.py"
    spec = spec_from_file_location(path.stem, path)
    script = module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


def test_the_script_tells_another_problem_from_the_same(tiny_bank, tiny_unwrapper):
    script = agreement()
    config = env_config(bank=tiny_bank, unwrapper=tiny_unwrapper, split="test", frames_per_drive=16)
    problem = open_problem(config)
    table = tabulate(problem, range(4)).table()
    same = script.compare(table, table)
    assert same["holds"] and len(same["choices"]) == 11 and abs(same["excess"]) < 1e-9
    # 2 DCS as dear as 8, and the other way round.
    other = script.compare(table, dataclasses.replace(table, cost=table.cost[..., ::-1].copy()))
    assert not other["holds"] and ("always 2", "always 8") in other["swapped"]
    assert other["excess"] > 0.02
