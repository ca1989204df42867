"""Which world a clip shows: that of its seed, but in the shift split one in which the ego moves."""

from __future__ import annotations

import numpy as np
import pytest

from shotenv.bank import clip_rendering
from shotenv.bank.clip_jobs import clip_jobs
from shotenv.bank.clip_rendering import SEEDS_APART, mean_speed_m_s, world_of
from shotenv.bank.files.layout import BankError
from shotenv.config.bank import BankConfig
from shotenv.config.families import SHIFT_FAMILIES
from shotenv.config.reader import find_config, merged, read_config
from shotenv.world import draw_world
from shotenv.world.geometry import Arc, Pose


@pytest.fixture(scope="module")
def starter() -> BankConfig:
    return read_config(BankConfig, find_config("bank", "starter"))


def way_m(world, config) -> float:
    """Length of the ego's way over a clip, in steps of a fifth of a frame."""
    duration_s = config.world.frames_per_clip / config.world.frame_rate_hz
    times = np.linspace(0.0, duration_s, 5 * config.world.frames_per_clip + 1)
    way = np.array([world.ego.at(float(time)).position_m[:2] for time in times])
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def test_in_each_shift_clip_of_starter_the_ego_moves(starter, tmp_path):
    jobs = [job for job in clip_jobs(starter, tmp_path) if job.split == "shift"]
    assert [sum(job.family == family for job in jobs) for family in SHIFT_FAMILIES] == [4] * 4
    worlds = [world_of(job) for job in jobs]
    assert min(way_m(world, starter) for world in worlds) > 0.3 * 2.4 - 1e-6
    # Some of their seeds give an ego that stands, or this would prove nothing.
    assert any(world.seed != job.seed for job, world in zip(jobs, worlds, strict=True))


def test_the_recorded_seed_gives_the_same_world(starter, tmp_path):
    jobs = [job for job in clip_jobs(starter, tmp_path) if job.split == "shift"]
    for job in jobs[:4]:
        world = world_of(job)
        assert (world.seed - job.seed) % SEEDS_APART == 0
        again = draw_world(job.family, world.seed, starter.world)
        assert np.array_equal(again.static.corners, world.static.corners)


def test_elsewhere_and_where_it_may_stand_the_world_is_that_of_the_seed(starter, tmp_path):
    may_stand = merged(starter, {"shift_mean_speed_m_s": 0.0})
    jobs = clip_jobs(starter, tmp_path)[:10] + clip_jobs(may_stand, tmp_path)[-16:]
    assert all(world_of(job).seed == job.seed for job in jobs)


def test_speed_counts_whatever_the_direction(starter):
    """To and fro is a way as well: 1 m each way in a clip of 2.4 s."""

    class Pendulum:
        def at(self, time_s):
            return Pose((1.0 - abs(1.0 - time_s / 1.2), 0.0, 1.0))

    class Moves:
        ego = Pendulum()

    assert mean_speed_m_s(Moves, starter) == pytest.approx(2.0 / 2.4)
    Moves.ego = Arc(Pose((0.0, 0.0, 1.0)))
    assert mean_speed_m_s(Moves, starter) == 0.0


def test_a_speed_that_no_ego_reaches_is_named(starter, tmp_path, monkeypatch):
    monkeypatch.setattr(clip_rendering, "MOST_WORLDS", 3)
    fast = merged(starter, {"shift_mean_speed_m_s": 14.9})
    job = next(job for job in clip_jobs(fast, tmp_path) if job.family == "warehouse")
    with pytest.raises(BankError, match=r"shift_mean_speed_m_s is 14\.9, .* of warehouse"):
        world_of(job)
