"""A budget of laser energy: knobs stand where it is spent, and what cannot be spent is refused."""

import json
import math

import numpy as np
import pytest
import torch

from agents.cli.entry import main
from agents.config.demo import DemoConfig
from agents.evaluation.budget import (
    BLIND,
    FIXED,
    Part,
    Plays,
    Setting,
    check_budget,
    mixed,
    scheduler_parts,
)
from agents.evaluation.play import make_envs
from agents.policies.fixed import FixedPolicy
from agents.policies.learned import NetworkPolicy, Provenance
from agents.policies.score_networks import score_network
from shotenv.config.reader import configs_dir, merged, read_config
from shotenv.decision.features import FEATURE_NAMES, feature_index

SEEDS = [1000, 1001]


class Known:
    """Plays of which the mean energy and error are told."""

    def __init__(self, points):
        self.points = points

    def energy_j(self, setting):
        return self.points[setting.words][0]

    def of(self, setting):
        error = np.full((1, 2), self.points[setting.words][1])
        return type("Drives", (), {"shots": np.full((1, 2), 8), "depth_mae_m": error})


def settings_of(points):
    return [Setting(FixedPolicy(8), None, name) for name in points]


POINTS = {"few": (2.0, 1.0), "poor": (4.0, 0.95), "good": (5.0, 0.4), "many": (10.0, 0.3)}


@pytest.mark.parametrize(
    ("budget_j", "shares"),
    [
        (2.0, {"few": 1.0}),
        (3.5, {"few": 0.5, "good": 0.5}),
        (5.0, {"good": 1.0}),
        (9.0, {"good": 0.2, "many": 0.8}),
        (12.0, {"many": 1.0}),
        (1.0, {"few": 1.0}),
    ],
)
def test_two_neighbours_of_the_hull_are_mixed_until_they_spend_the_budget(budget_j, shares):
    parts = mixed(settings_of(POINTS), budget_j, Known(POINTS), 25.0)
    assert {part.setting.words: part.share for part in parts} == pytest.approx(shares)


@pytest.fixture(scope="module")
def config(tiny_bank, tiny_unwrapper) -> DemoConfig:
    return merged(
        read_config(DemoConfig, configs_dir() / "demo.yaml"),
        {
            "env": {"bank": tiny_bank, "unwrapper": tiny_unwrapper, "frames_per_drive": 24},
            "study": {
                **{"drives": 2, "tuning_drives": 2, "bootstrap_draws": 100},
                **{"prices": [0.02, 0.2], "families": ["fixed"]},
            },
        },
    )


@pytest.fixture(scope="module")
def scheduler() -> NetworkPolicy:
    """8 DCS at the start of a drive, the longer the cheaper power is, then 2."""
    network = score_network((len(FEATURE_NAMES), 3), "tanh")
    layer = network[0]
    for values in (layer.weight, layer.bias):
        values.data.zero_()
    layer.bias.data[:] = torch.tensor([0.0, -9.0, 0.5])
    for name, weight in (("power_price", -1.0), ("time_left", 0.4)):
        layer.weight.data[2, feature_index(FEATURE_NAMES, name)] = weight
    told = Provenance(algorithm="by hand", feature_names=FEATURE_NAMES, power_price=(0.01, 0.35))
    return NetworkPolicy(network, told)


@pytest.fixture(scope="module")
def plays(config) -> Plays:
    return Plays(make_envs(config.env, "validation", 2, "Disabled"), SEEDS)


def test_the_knob_stands_at_the_price_that_spends_the_budget(config, scheduler, plays):
    def spent(price):
        return plays.energy_j(Setting(scheduler, price, "scheduler"))

    least, most = spent(0.35), spent(0.01)
    assert plays.energy_j(FIXED[0]) < least < most < plays.energy_j(FIXED[2])
    budget_j = (least + most) / 2
    ((share, setting),) = scheduler_parts(scheduler, config, budget_j, plays)
    assert share == 1.0 and spent(setting.price) <= budget_j < spent(setting.price / 1.02)
    # Where its own prices do not reach, fixed choices help.
    for budget_j, other in ((0.99 * least, "always_2"), (1.01 * most, "always_8")):
        parts = scheduler_parts(scheduler, config, budget_j, plays)
        assert other in {part.setting.words for part in parts}
        total = sum(part.share * plays.energy_j(part.setting) for part in parts)
        assert total == pytest.approx(budget_j)


def test_what_is_played_twice_is_played_once(plays):
    assert plays.of(BLIND[0]) is plays.of(FIXED[0])
    assert Part(1.0, FIXED[0]) in mixed(BLIND, 0.0, plays, 25.0)


@pytest.mark.parametrize("budget_j", [-1.0, 0.0, math.nan, math.inf, 1e-6, 1e6])
def test_a_budget_that_cannot_be_spent_is_refused_with_the_range(plays, budget_j):
    least, most = (plays.energy_j(FIXED[i]) for i in (0, 2))
    with pytest.raises(ValueError, match=f"budget is .* J; expected {least:.4g} to {most:.4g} J"):
        check_budget(budget_j, plays)
    assert check_budget(most, plays) == (least, most)


def test_a_budget_is_judged_told_and_shown(config, scheduler, plays, tmp_path, capsys):
    scheduler.save(tmp_path / "agent")
    test = Plays(make_envs(config.env, "test", 2, "Disabled"), SEEDS)
    least, most = (test.energy_j(FIXED[i]) for i in (0, 2))
    words = ["evaluate", str(tmp_path / "agent"), "--out", str(tmp_path / "out")]
    words += ["--env.bank", config.env.bank, "--env.unwrapper", config.env.unwrapper]
    words += ["--env.frames_per_drive", "24", "--study.drives", "2", "--study.tuning_drives", "2"]
    words += ["--study.bootstrap_draws", "100", "--study.prices", "[0.02,0.2]"]
    words += ["--study.families", "[fixed]"]
    assert main([*words, "--budget", "99"]) == 1
    assert "budget is 99 J; expected" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
    budget_j = 0.4 * least + 0.6 * most
    assert main([*words, "--budget", str(budget_j)]) == 0
    printed = capsys.readouterr().out
    told = json.loads((tmp_path / "out" / "results.json").read_text())["budget"]
    assert told["possible_j"] == pytest.approx([least, most])
    assert told["optimum"]["laser_energy_j"]["mean"] <= budget_j * (1 + 1e-9)
    assert set(told["policies"]) == {"scheduler", "fixed", "blind"}
    for name, one in told["policies"].items():
        energy = one["laser_energy_j"]
        assert energy["low"] <= energy["mean"] <= energy["high"]
        assert energy["mean"] <= one["worst_drive_j"] and 0 <= one["drives_over_share"] <= 1
        assert sum(part["share"] for part in one["setting"]) == pytest.approx(1.0)
        if energy["mean"] <= told["optimum"]["laser_energy_j"]["mean"]:
            # What the optimum makes most of; the grid of temperatures allows for a little.
            assert one["below_optimum_return"]["difference"] >= -0.05, name
    page = (tmp_path / "out" / "report.html").read_text()
    assert f"A budget of {budget_j:g} J" in page and f"budget of {budget_j:g} J" in printed
    assert "above the optimum" in printed
