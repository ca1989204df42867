"""Measures of a table: of parts of its clips, differences of rows, and which clips are which."""

import numpy as np
import pytest

from agents.config.agent import AgentConfig
from agents.config.demo import DemoConfig
from agents.config.study_config import StudyConfig
from agents.evaluation.play import drive_seeds, make_envs, play_drives
from agents.evaluation.price_sweep import PlayedFront
from agents.optimum.fronts import Front, by_clip
from agents.policies.fixed import FixedPolicy
from agents.study.clip_groups import clip_groups
from agents.study.table_fronts import TableFronts
from shotenv.config.env import EnvConfig
from shotenv.config.reader import configs_dir, merged, read_config

CLIPS, PRICES = 10, (0.02, 0.09, 0.2)
STUDY = StudyConfig(bootstrap_draws=100)


def front_like(rng, policies=("a", "b", "c"), worse_m=0.0) -> PlayedFront:
    """Energy falls and error rises with the price, each clip in its own way."""
    frames = np.linspace(5.0, 14.0, CLIPS)
    points = len(policies)
    energy = np.linspace(0.95, 0.25, points) * frames[:, None]
    clip = np.random.default_rng(0).uniform(0.3, 3.0, (CLIPS, 1))
    error_m = (0.4 + np.linspace(0.0, 0.8, points) + worse_m) * clip
    error_m = (error_m + 0.05 * rng.random((CLIPS, points))) * frames[:, None]
    sums = rng.normal(size=(CLIPS, points))
    prices = PRICES if points == len(PRICES) else (None,) * points
    return PlayedFront(
        Front(energy, error_m, frames), prices, policies, 100.0 - error_m, sums, sums
    )


@pytest.fixture
def fronts() -> TableFronts:
    rng = np.random.default_rng(1)
    blind = front_like(rng, ("always_8", "always_4", "x", "always_2"), worse_m=0.5)
    good, bad = ([front_like(rng, worse_m=worse) for _ in range(2)] for worse in (0.1, 0.4))
    optimum = front_like(rng)
    cool_m = 0.45 * optimum.front.frames
    return TableFronts({"good": good, "bad": bad}, blind, optimum, cool_m, 0.09)


def test_a_part_of_the_clips_is_measured_as_if_the_others_had_no_weight(fronts):
    chosen = np.arange(CLIPS) % 3 == 0
    part = fronts.of_clips(chosen).measured(np.ones(chosen.sum()))
    weighed = fronts.measured(chosen.astype(float))
    for name, row in weighed.items():
        assert set(row) >= {"gap_closed", "error_at_half_energy", "return", "depth_mae_m"}
        for measure, values in row.items():
            np.testing.assert_allclose(part[name][measure], values, err_msg=measure)


def test_means_at_the_price_are_those_of_the_point_that_was_played_at_it(fronts):
    measured = fronts.measured(np.ones(CLIPS))["good"]
    for seed, front in enumerate(fronts.rows["good"]):
        point = front.rows[PRICES.index(0.09)]
        for measure in ("return", "depth_mae_m", "laser_energy_share"):
            assert measured[measure][seed] == pytest.approx(point[measure])


def test_the_difference_of_rows_is_paired_over_clips(fronts):
    table = fronts.resampled(STUDY, "a test")
    rows, told = table.rows(), table.differences("good")["bad"]["error_at_half_energy"]
    good, bad = (rows[name]["error_at_half_energy"] for name in ("good", "bad"))
    assert told["difference"] == pytest.approx(good["iqm"] - bad["iqm"])
    assert told["high"] < 0 and told["significant"]
    # Clips differ much more from each other than the rows do on any of them.
    assert told["high"] - told["low"] < 0.5 * (bad["high"] - bad["low"])


def test_a_row_does_not_differ_significantly_from_its_like(fronts):
    twin = TableFronts(
        {"one": fronts.rows["good"], "other": fronts.rows["good"]},
        *(fronts.blind, fronts.optimum, fronts.cool_eight_m, fronts.price),
    )
    for told in twin.resampled(STUDY, "a test").differences("one")["other"].values():
        assert told["difference"] == 0.0 and not told["significant"]


def test_groups_hold_every_clip_that_was_played_once(tiny_kwargs):
    shipped = read_config(EnvConfig, configs_dir() / "env" / "default.yaml")
    env = merged(shipped, {**tiny_kwargs, "frames_per_drive": 16})
    config = DemoConfig(env=env, agent=AgentConfig(), study=StudyConfig(drives=3))
    groups = clip_groups(config)
    played = play_drives(
        FixedPolicy(2), make_envs(env, "test", 3, "Disabled"), drive_seeds(config.study, 3)
    )
    clips = np.unique(played.clip)
    for kind in groups.values():
        np.testing.assert_array_equal(sum(chosen.astype(int) for chosen in kind.values()), 1)
        assert all(len(chosen) == len(clips) for chosen in kind.values())
    for family, chosen in groups["family"].items():
        share = by_clip((played.family == family).astype(float), played.clip) > 0
        np.testing.assert_array_equal(chosen, share)
    sizes = [int(chosen.sum()) for chosen in groups["ego_speed"].values()]
    assert max(sizes) - min(sizes) <= 1
    lows = [float(name.split()[0]) for name in groups["ego_speed"]]
    assert lows == sorted(lows)
