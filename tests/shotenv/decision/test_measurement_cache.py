"""A cache of measurements gives the same numbers, measures nothing twice and does not grow on."""

from __future__ import annotations

import numpy as np
import pytest

from shotenv.decision import measurement_cache
from shotenv.decision.measurement_cache import MeasurementCache
from shotenv.env.vector import ShotScheduleVectorEnv

SEEDS = [3, 4, 5]


def drive_along(envs, seed):
    """Observations and rewards of random actions over a whole drive."""
    actions = np.random.default_rng(seed)
    seen = [envs.reset(seed=SEEDS)[0]]
    for _ in range(envs.problem.config.frames_per_drive):
        observation, reward, *_ = envs.step(actions.integers(0, 3, envs.num_envs))
        seen += [observation, reward]
    return seen


@pytest.fixture
def measured(monkeypatch):
    """How many frames were measured in each call."""
    counts = []

    def counted(problem, drive, step, *chosen, real=measurement_cache.measure_frames):
        counts.append(len(step))
        return real(problem, drive, step, *chosen)

    monkeypatch.setattr(measurement_cache, "measure_frames", counted)
    return counts


def test_a_remembered_drive_is_the_same_drive(tiny_kwargs):
    plain = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", **tiny_kwargs)
    remembering = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", remember=True, **tiny_kwargs)
    for actions in (0, 1, 0):
        for one, other in zip(
            drive_along(plain, actions), drive_along(remembering, actions), strict=True
        ):
            np.testing.assert_array_equal(one, other)


def test_nothing_is_measured_twice(tiny_kwargs, measured):
    envs = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", remember=True, **tiny_kwargs)
    drive_along(envs, 0)
    once = sum(measured)
    drive_along(envs, 0)
    assert once == sum(measured) == 3 * tiny_kwargs["frames_per_drive"]


def test_a_full_cache_keeps_what_it_has_and_measures_the_rest(tiny_kwargs, measured):
    envs = ShotScheduleVectorEnv(3, autoreset_mode="Disabled", remember=True, **tiny_kwargs)
    plain = drive_along(envs, 0)
    envs._measure = cache = MeasurementCache(most_kept=40)
    measured.clear()
    for _ in range(2):
        for one, other in zip(drive_along(envs, 0), plain, strict=True):
            np.testing.assert_array_equal(one, other)
    assert 38 <= len(cache) <= 40
    assert sum(measured) == 2 * 3 * tiny_kwargs["frames_per_drive"] - len(cache)
