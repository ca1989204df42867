"""Simulated drives, and the same recorded and played again."""

from __future__ import annotations

import pytest
from word_banks import record, replayed_problem

from shotenv.config.keywords import env_config
from shotenv.decision.problem import open_problem


@pytest.fixture(scope="session")
def simulated(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return open_problem(env_config(**tiny_kwargs, split="test"))


@pytest.fixture(scope="session")
def drives(simulated):
    return [record(simulated, seed, name=f"drive_{seed}") for seed in (5, 6, 2**61 + 7)]


@pytest.fixture(scope="session")
def replayed(simulated, drives, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        return replayed_problem(simulated, drives)
