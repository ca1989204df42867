import dataclasses
import html
import json
import re

import numpy as np
import pytest

from agents.config.demo import DemoConfig
from agents.evaluation.acceptance import judged
from agents.evaluation.headroom import measure_problem
from agents.evaluation.play import (
    FIXED_POLICIES,
    PlayedDrives,
    make_envs,
    play_drives,
    play_optimum,
)
from agents.evaluation.price_sweep import MIXTURES
from agents.evaluation.study import (
    check_study,
    evaluate_scheduler,
    families_of,
    play_all,
    tune_families,
    warn_of_environment,
    warn_of_prices,
)
from agents.optimum.choices import always, threshold
from agents.optimum.dynamic import clairvoyant
from agents.optimum.outcome_table import play
from agents.optimum.tabulation import tabulate
from agents.policies.fixed import FixedPolicy, RandomPolicy
from agents.policies.learned import NetworkPolicy, Provenance
from agents.policies.rules import SnrThresholdPolicy
from agents.policies.score_networks import score_network
from agents.report.evaluation_files import write_evaluation
from agents.report.page import write_report
from agents.report.strip import take_strip
from agents.training.scheduler import train_scheduler
from shotenv.config.keywords import env_config
from shotenv.config.reader import configs_dir, merged, read_config
from shotenv.decision.features import FEATURE_NAMES
from shotenv.decision.problem import open_problem

SEEDS = [1000, 1001, 1002]
HOT = {
    "thermal_resistance_k_per_w": 200.0,
    "thermal_time_constant_s": 1.0,
    "optical_power_w": [6.0, 8.5],
    "ambient_k": [304.15, 310.15],
}


@pytest.fixture(scope="module")
def config(tiny_bank, tiny_unwrapper) -> DemoConfig:
    """The demo on the tiny bank, with a laser that gets hot soon enough to trip."""
    whole = read_config(DemoConfig, configs_dir() / "demo.yaml")
    return merged(
        whole,
        {
            "env": {
                "bank": tiny_bank,
                "unwrapper": tiny_unwrapper,
                "frames_per_drive": 24,
                "laser": HOT,
                "sensor": {"integration_s": [5.5e-4, 7.5e-4]},
                "reward": {"power": 0.005},
                "protect": False,
            },
            "agent": {
                "algorithm": "ppo",
                "power_price": None,
                "ppo": {"total_steps": 96, "num_envs": 2, "rollout_steps": 24, "batch_size": 16},
            },
            "study": {
                "drives": 3,
                "tuning_drives": 2,
                "bootstrap_draws": 200,
                "prices": [0.005, 0.3],
                "families": ["fixed", "snr_threshold"],
            },
        },
    )


def scheduler_of(power_price, names=FEATURE_NAMES):
    told = Provenance(algorithm="none", feature_names=names, power_price=power_price)
    return NetworkPolicy(score_network((len(names), 3), "tanh"), told)


@pytest.fixture(scope="module")
def possible(config):
    problem = open_problem(config.env.model_copy(update={"split": "test"}))
    return tabulate(problem, SEEDS)


def test_tables_tell_what_the_environment_does(config, possible):
    envs = make_envs(config.env, "test", len(SEEDS), "Disabled")
    table = possible.table()
    # The median, so that the rule takes both of its actions.
    rule = (float(np.median(table.snr)), 2, 0)
    for policy, choose in [
        (FixedPolicy(8), always(2)),
        (SnrThresholdPolicy(FEATURE_NAMES, rule[0], below=8, above=2), threshold(*rule)),
    ]:
        played, on_table = play_drives(policy, envs, SEEDS), play(table, choose)
        returns = table.returns(on_table.frame_cost)
        np.testing.assert_allclose(played.per_drive["return"], returns, rtol=1e-9)
        np.testing.assert_array_equal(played.shots == 0, on_table.actions < 0)
    assert (on_table.actions == 2).any() and (on_table.actions == 0).any()


def test_the_hot_laser_trips_and_the_optimum_beats_every_fixed_choice(config, possible):
    table = possible.table()
    best = clairvoyant(table).cost
    fixed = [play(table, always(action)) for action in range(3)]
    assert fixed[2].tripped_share > 0
    for one in fixed:
        assert (best <= one.cost + 1e-9).all()
    assert best.sum() < 0.99 * min(one.cost.sum() for one in fixed)


def test_the_optimum_played_is_that_of_the_table(config, possible):
    problem = open_problem(config.env.model_copy(update={"split": "test"}))
    best, frames = clairvoyant(possible.table()), []
    played = play_optimum(problem, SEEDS, tick=frames.append)
    np.testing.assert_array_equal(played.shots, np.array([2, 4, 8, 0])[best.actions])
    returns = possible.table().returns(best.frame_cost)
    np.testing.assert_allclose(played.per_drive["return"], returns, rtol=1e-9)
    assert sum(frames) == played.shots.size


def test_the_optimum_of_a_derated_laser_is_not_known(config):
    derated = merged(config, {"env": {"split": "test", "laser": {"derate_per_k": 0.03}}})
    assert play_optimum(open_problem(derated.env), SEEDS) is None


def test_policies_are_remembered_with_what_they_saw_and_asked_for(config):
    envs = make_envs(config.env, "test", len(SEEDS), "Disabled")
    played = play_drives(FixedPolicy(8), envs, SEEDS)
    assert (played.asked == 8).all() and (played.shots == 0).any()
    first, _ = envs.reset(seed=SEEDS)
    np.testing.assert_array_equal(played.observations[:, 0], first)
    after, *_ = envs.step(np.full(len(SEEDS), 2))
    np.testing.assert_array_equal(played.observations[:, 1], after)


def test_a_drive_is_the_same_in_any_autoreset_mode(config):
    one, other = (
        play_drives(RandomPolicy(3), make_envs(config.env, "test", 3, mode), SEEDS)
        for mode in ("Disabled", "SameStep")
    )
    for field in dataclasses.fields(PlayedDrives):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name))


def test_frames_without_laser_have_no_error_and_no_share(config):
    envs = make_envs(config.env, "test", 3, "Disabled")
    played = play_drives(FixedPolicy(8), envs, SEEDS)
    off = played.shots == 0
    assert off.any() and np.isnan(played.depth_mae_m[off]).all()
    assert np.isfinite(played.depth_mae_m[~off]).all()
    assert played.shots_share() == [0.0, 0.0, 1.0]
    np.testing.assert_allclose(played.per_drive["tripped_share"], off.mean(axis=1))


def test_families_are_tuned_at_every_price_and_at_that_of_the_drives(config):
    dear = merged(config, {"study": {"prices": [0.3, 5.0], "families": ["fixed"]}})
    tuned = tune_families(dear)["fixed"]
    assert set(tuned) == {0.005, 0.3, 5.0}
    assert tuned[5.0].policy.action == 0, "power this dear leaves 2 DCS alone"


def test_a_family_that_there_is_none_of_is_named(config):
    with pytest.raises(ValueError, match="families has 'guess'; expected of fixed, cycle"):
        families_of(merged(config, {"study": {"families": ["guess"]}}).study)


def test_problem_numbers_follow_the_weights(config, possible):
    study = config.study
    free = measure_problem(*[possible] * 3, study, price=0.0)
    dear = measure_problem(*[possible] * 3, study, price=50.0)
    assert free["optimum"]["shots_share"]["8"]["mean"] > 0.0
    assert dear["optimum"]["shots_share"]["2"]["mean"] == 1.0
    assert dear["excess"]["best_fixed"]["excess"] == pytest.approx(0.0)
    assert dear["excess"]["best_fixed"]["choice"] == "always 2" and not judged(dear)["holds"]
    assert free["excess"]["best_blind"]["excess"] <= free["excess"]["best_fixed"]["excess"] + 1e-12


def test_strip_shows_the_frames_that_were_played(config):
    envs = make_envs(config.env, "test", config.study.drives, "Disabled")
    played = play_all({"always_8": FixedPolicy(8)}, envs, config.study)["always_8"]
    problem = open_problem(config.env.model_copy(update={"split": "test"}))
    strip = take_strip(problem, played)
    assert set(strip.family.tolist()) == set(played.family.ravel().tolist())
    assert (strip.shots == 8).all()
    for i in range(len(strip.frame)):
        drive = played.seeds.tolist().index(strip.drive[i])
        assert played.depth_mae_m[drive, strip.frame[i]] == strip.depth_mae_m[i]
        scored = strip.valid[i] & (strip.truth_m[i] <= strip.max_range_m)
        # float16 and the wiggle allow some centimetres, another frame's images would be metres off.
        error_m = np.abs(strip.corrected_m[i][scored] - strip.truth_m[i][scored])
        assert np.median(error_m) < 0.5


def text_of(page):
    """What a reader sees of a page: its text, without scripts, styles and tags."""
    bare = re.sub(r"<(script|style)>.*?</\1>", " ", page, flags=re.DOTALL)
    return " ".join(html.unescape(re.sub(r"<[^>]*>", " ", bare)).split())


def test_train_and_evaluate_write_everything_the_report_needs(config, tmp_path):
    scheduler = train_scheduler(config, tmp_path / "agent")
    evaluation = evaluate_scheduler(config, scheduler)
    assert {path.name for path in tmp_path.iterdir()} == {"agent"}, "judging writes nothing"
    write_evaluation(evaluation, config, tmp_path)
    shown = text_of(write_report(tmp_path).read_text())
    assert "Every policy drove the same 3 drives of the test split" in shown
    assert "over 3 test drives" in shown and "Wrapped map, 24 MHz" in shown
    for policy in ("Scheduler", "SNR threshold rule", "Random", "Always 8 DCS"):
        assert policy in shown
    results = evaluation.results
    assert results["policies"]["snr_threshold"]["rule"] in shown
    assert "trained at one price, 0.005" in shown and results["answer"]["prices"] == [0.005]
    assert {name: len(rows) for name, rows in results["fronts"].items()} == {
        **{"scheduler": 1, "fixed": 2, "snr_threshold": 2, "optimum": 2},
        "blind": len(FIXED_POLICIES) + len(MIXTURES),
    }
    assert results["answer"]["measures"]["optimum"]["gap_closed"]["mean"] == pytest.approx(1.0)
    assert results["answer"]["measures"]["blind"]["gap_closed"]["mean"] == pytest.approx(0.0)
    assert {path.name for path in tmp_path.iterdir()} == {
        *("agent", "results.json", "drives.csv", "timeline.json", "choices.json", "frames.npz"),
        "report.html",
    }
    assert json.loads((tmp_path / "results.json").read_text()) == evaluation.results
    for policy in results["policies"].values():
        assert 0.0 < policy["within_0p1m"]["mean"] <= policy["wrap_accuracy"]["mean"]
        assert policy["temporal_error_m"]["mean"] > 0.0
    rows = (tmp_path / "drives.csv").read_text().splitlines()
    assert "within_0p1m,temporal_error_m" in rows[0]
    assert len(rows) == 1 + len(evaluation.played) * len(SEEDS)
    with pytest.raises(ValueError, match="other features"):
        evaluate_scheduler(config, scheduler_of(None, ("heat_margin",)))


@pytest.mark.parametrize(
    ("trained", "says"),
    [
        ((0.001, 0.4), ""),
        ((0.001, 0.1), "not played: prices 0.3; the scheduler was trained with 0.001 to 0.1\n"),
        ((0.005, 0.005), "trained at one price, 0.005: its front is one point\n"),
        ((0.1, 0.4), "reward.power is 0.005 to 0.005, outside of 0.1 to 0.4, which"),
        (None, ""),
    ],
)
def test_prices_outside_of_the_training_are_named(config, capsys, trained, says):
    warn_of_prices(config, scheduler_of(trained))
    told = capsys.readouterr().err
    assert says in told and bool(told) == bool(says)


def test_another_environment_than_that_of_the_training_is_named(capsys):
    trained, hot = env_config(), env_config("hot", split="shift")
    told = Provenance(
        algorithm="none", feature_names=("power",), environment=trained.model_dump(mode="json")
    )
    scheduler = NetworkPolicy(score_network((1, 3), "tanh"), told)
    warn_of_environment(env_config(split="test", reward={"power": 0.3}), scheduler)
    assert capsys.readouterr().err == ""
    warn_of_environment(hot, scheduler)
    said = capsys.readouterr().err
    now, then = (one.laser.thermal_resistance_k_per_w for one in (hot, trained))
    assert "trained in another environment: laser." in said
    assert f"laser.thermal_resistance_k_per_w {now} (trained: {then})" in said


def test_a_scheduler_that_knows_none_of_the_prices_is_refused(config):
    with pytest.raises(ValueError, match=r"prices is 0.005, 0.3; expected at least one from 0.4"):
        check_study(config, scheduler_of((0.4, 0.5)))
