"""`shotenv evaluate` on recordings: what can be played is, what is not known is named."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest
from word_banks import record, write_folder

from agents.cli.cameras.camera_commands import read_camera
from agents.cli.entry import main
from agents.optimum.tabulation import tabulate
from agents.policies.learned import NetworkPolicy
from agents.policies.scheduler_files import Provenance
from agents.policies.score_networks import score_network
from shotenv.config.keywords import env_config
from shotenv.config.reader import find_config
from shotenv.decision.features import FEATURE_NAMES
from shotenv.decision.problem import open_problem
from shotenv.env.single import ShotScheduleEnv
from shotenv.recorded.bank_import import import_bank


@pytest.fixture(scope="module")
def drives(tiny_kwargs, session_cache):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SHOTENV_CACHE", session_cache)
        kwargs = {**tiny_kwargs, "frames_per_drive": 8}
        problem = open_problem(env_config(**kwargs, split="test"))
        return [record(problem, seed) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def imported(drives, tmp_path_factory):
    """Bank by number of samples, level of truth and number of recordings."""

    def make(samples=8, truth=None, count=3):
        folder = tmp_path_factory.mktemp("made")
        named = truth == "external"
        write_folder(folder / "in", drives[:count], samples=samples, truth=named)
        camera, _ = read_camera(str(folder / "in" / "camera" / "bench.yaml"))
        sensor = find_config("sensor", "epc660")
        return import_bank(folder / "in", camera, sensor, folder / "bank", truth=truth)

    return make


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scheduler")
    told = Provenance(algorithm="none", feature_names=FEATURE_NAMES, power_price=(0.01, 0.3))
    NetworkPolicy(score_network((len(FEATURE_NAMES), 3), "tanh"), told).save(folder)
    return folder


@pytest.fixture
def judged(scheduler, tiny_unwrapper, tmp_path, capsys):
    """Results, printed words and page of an evaluation on a bank."""

    def judge(bank):
        small = "--study.drives 6 --study.bootstrap_draws 200 --study.prices [0.02,0.3]"
        words = ("evaluate", str(scheduler), "--env", str(bank.folder / "env.yaml"))
        network = ("--env.unwrapper", tiny_unwrapper, "--out", str(tmp_path))
        status = main([*words, *small.split(), *network])
        out, err = capsys.readouterr()
        assert status == 0, err
        text = (tmp_path / "results.json").read_text()
        assert "NaN" not in text
        return json.loads(text), out, (tmp_path / "report.html").read_text()

    return judge


def test_eight_samples_with_a_reference_are_judged_as_drives_are(imported, judged):
    results, out, page = judged(imported(truth="external"))
    assert results["truth"] == "external" and results["recorded"]
    assert set(results["policies"]) == {"scheduler", "random", "always_2", "always_4", "always_8"}
    assert results["answer"]["measures"]["scheduler"]["error_at_half_energy"]["mean"] > 0
    for told in (out, page):
        assert "Left out: tuned rules: bank bench has no validation clips" in told
        assert "Drives are recordings, scored against the reference" in told


def test_their_own_truth_is_told_and_eight_have_no_depth_error(imported, judged, tmp_path):
    results, out, page = judged(imported(truth="own"))
    assert results["truth"] == "own"
    always = {shots: results["policies"][f"always_{shots}"] for shots in (2, 4, 8)}
    assert always[8]["depth_mae_m"] is None
    assert always[2]["depth_mae_m"]["mean"] > always[4]["depth_mae_m"]["mean"] > 0
    best = max(one["return"]["mean"] for one in results["policies"].values())
    assert results["policies"]["optimum"]["return"]["mean"] == best
    assert "8 DCS are not scored against themselves" in out
    assert "Truth: own." in page and page.count("<tr") == 1 + len(results["policies"])
    # The page is written anew from its numbers.
    (tmp_path / "report.html").unlink()
    assert main(["report", str(tmp_path)]) == 0
    assert (tmp_path / "report.html").read_text() == page


def test_four_samples_are_played_by_two_and_four_alone(imported, judged, tmp_path):
    results, out, _ = judged(imported(samples=4))
    assert (results["truth"], results["answers"]) == ("none", [2, 4])
    assert set(results["policies"]) == {"scheduler", "random", "always_2", "always_4"}
    assert all(one["shots_share"][2] == 0 for one in results["policies"].values())
    assert results["policies"]["random"]["shots_share"][1] > 0.4
    for what in ("always 8 DCS", "tuned rules", "optimum"):
        assert any(sentence.startswith(what) for sentence in results["left_out"])
        assert f"left out: {what}" in out
    with (tmp_path / "drives.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6 * 4 and {row["depth_mae_m"] for row in rows} == {"nan"}


def test_one_recording_has_no_intervals(imported, judged):
    results, _, page = judged(imported(truth="external", count=1))
    told = results["policies"]["always_8"]["depth_mae_m"]
    assert told["low"] is None and told["mean"] > 0
    assert "Of one clip there are no intervals." in page


def test_the_optimum_takes_what_was_recorded(imported, tiny_unwrapper):
    bank = imported(samples=4, truth="external")
    config = env_config(str(bank.folder / "env.yaml"), unwrapper=tiny_unwrapper)
    table = tabulate(open_problem(config), [0, 1]).table()
    assert np.isinf(table.cost[..., 2]).all() and np.isfinite(table.cost[..., :2]).all()
    assert np.isnan(table.depth_mae_m[..., 2]).all()


def test_outcomes_of_what_was_not_recorded_are_not_known(imported, tiny_unwrapper):
    bank = imported(samples=4, truth="external")
    config = str(bank.folder / "env.yaml")
    env = ShotScheduleEnv(config, outcomes=True, unwrapper=tiny_unwrapper)
    env.reset(seed=0)
    assert env.action_masks().tolist() == [True, True, False]
    _, reward, *_, info = env.step(1)
    rewards = info["outcomes"]["reward"]
    assert rewards[1] == reward and np.isnan(rewards[2])
    assert info["outcomes"]["shots"].tolist() == [2, 4, 0]
    with pytest.raises(ValueError, match=r"action is 2 \(8 DCS\), but bank bench only answers"):
        env.step(2)
