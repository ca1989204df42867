"""A whole study on the tiny bank: jobs, what is kept of them, what is refused, and the table."""

import json

import numpy as np
import pytest
import yaml
from short_studies import plan_of

from agents.cli.entry import main
from agents.config.study_plan import StudyPlan
from agents.evaluation.play import drive_seeds, make_envs, play_drives
from agents.evaluation.price_sweep import PlayedFront
from agents.evaluation.study import tune_families
from agents.optimum.fronts import Front
from agents.policies.learned import load_policy
from agents.study import job_runs
from agents.study.job_results import JobResult, read_result, stands, write_result
from agents.study.jobs import jobs_of
from agents.study.leaderboard import make_leaderboard
from shotenv.config.reader import ConfigError, configs_dir, read_config

ELSEWHERE = {"source": "short", "policies": ["fixed"], "tables": {"hot": {}}}
"""A transfer that is possible."""


def test_jobs_are_policies_x_presets_x_seeds(files):
    names = {job.name for job in jobs_of(plan_of(files))}
    assert names == {
        "short/references-0",
        "short/fixed-0",
        *(f"short/{p}-{s}" for p in ("fast", "linear", "random", "no_heat") for s in (0, 1)),
    }


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"policies": ["fixed", "wishful"]}, "policies has 'wishful'; expected random, of dqn"),
        ({"policies": ["fixed", "fixed"]}, "policies has 'fixed', but 'fixed' is taken"),
        ({"presets": ["moon"]}, "presets: env is 'moon'; expected one of battery"),
        (
            {"ablations": {"x": {"policy": "ppo", "unseen": ["power"]}}},
            "ablations.x.policy is 'ppo', which learns by ppo; expected a regression",
        ),
        (
            {"ablations": {"x": {"policy": "ppo", "agent": {"ppo": {"horizon": 1}}}}},
            "ablations.x.agent: unknown key ppo.horizon; expected one of total_steps",
        ),
        (
            {"transfer": {"policies": ["fixed"], "tables": {"hot": {}}}},
            "transfer.source has 'default'; expected of short",
        ),
        (
            {"transfer": {**ELSEWHERE, "policies": ["ppo"]}},
            "transfer.policies has 'ppo'; expected of fast, linear, random, fixed, no_heat",
        ),
        (
            {"transfer": {**ELSEWHERE, "tables": {"short": {}}}},
            "transfer.tables has 'short', which is a preset's",
        ),
        (
            {"transfer": {**ELSEWHERE, "tables": {"moon": {"preset": "moon"}}}},
            "transfer.tables.moon.preset: env is 'moon'; expected one of battery",
        ),
        (
            {"transfer": {**ELSEWHERE, "tables": {"dim": {"env": {"laser": {"watts": 1}}}}}},
            "transfer.tables.dim.env: unknown key laser.watts; expected one of name, optical_pow",
        ),
        (
            {"ablations": {"x": {"policy": "regression", "unseen": ["mood"]}}},
            "ablations.x.unseen: feature_names has no 'mood'",
        ),
        (
            {"ablations": {"x": {"policy": "regression", "unseen": ["power"]}}},
            "ablations.x.presets has 'default'; expected of short",
        ),
        (
            {"ablations": {"fixed": {"policy": "regression", "unseen": ["power"],
                                     "presets": ["short"]}}},
            "ablations has 'fixed', which is taken",
        ),
    ],
)  # fmt: skip
def test_what_there_is_none_of_is_refused_by_name(files, changes, told):
    with pytest.raises(ConfigError) as caught:
        jobs_of(plan_of(files, **changes))
    assert told in str(caught.value)


def test_an_empty_study_is_refused(tmp_path, capsys):
    empty = tmp_path / "empty.yaml"
    empty.write_text("policies: []\npresets: [default]\nseeds: [0]\n")
    assert main(["study", str(empty), "--out", str(tmp_path / "out")]) == 2
    assert "policies" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_study_that_ships_can_be_read():
    plan = read_config(StudyPlan, configs_dir() / "study" / "results.yaml")
    jobs = jobs_of(plan)
    assert len(plan.seeds) >= 5
    seeds = len(plan.seeds)
    # References and fifteen rules once; six learners and random with each seed; four ablations.
    default = 1 + 15 + (7 + 4) * seeds
    # References and a rule; one learner there, two in each table of the transfer.
    hot, elsewhere = 1 + 1 + seeds, len(plan.transfer.tables) * (1 + 1 + 2 * seeds)
    assert len(jobs) == default + hot + elsewhere
    greedy = next(job for job in jobs if job.policy == "greedy")
    assert greedy.config.agent.regression.horizon == 1


def test_a_preset_may_have_some_of_the_policies_alone(files):
    plan = plan_of(
        files, ablations={}, presets={"hot": ["random"], str(files / "short.yaml"): "all"}
    )
    names = [job.name for job in jobs_of(plan) if job.table == "hot"]
    assert sorted(names) == ["hot/random-0", "hot/random-1", "hot/references-0"]
    with pytest.raises(ConfigError, match=r"presets\.hot has 'ppo'; expected of fast, linear"):
        jobs_of(plan_of(files, presets={"hot": ["ppo"]}, ablations={}))


def run_here(jobs, folder):
    """Every job, in this process."""
    folder.mkdir(exist_ok=True)
    banks = job_runs.banks_of(jobs)
    for job in jobs:
        job_runs.run_job(job_runs.JobTask(job, folder, job.depends_on(banks)))


@pytest.fixture
def transferred(files):
    """Jobs of a scheduler and a rule of the short preset, played on a longer drive in the heat."""
    elsewhere = {
        "source": "short",
        "policies": ["fast", "snr_threshold"],
        "tables": {
            "heat": {
                "preset": str(files / "short.yaml"),
                "env": {"laser": {"ambient_k": [320.0, 325.0]}, "reward": {"power": 0.05}},
            }
        },
    }
    policies = [str(files / "fast.yaml"), "snr_threshold"]
    return jobs_of(plan_of(files, policies=policies, ablations={}, seeds=[0], transfer=elsewhere))


def test_a_transfer_plays_what_was_trained_and_tuned_on_its_source(files, transferred, monkeypatch):
    out = files / "out"
    jobs = {job.name: job for job in transferred}
    assert set(jobs) == {
        f"{table}/{row}-0"
        for table in ("short", "heat")
        for row in ("references", "fast", "snr_threshold")
    }
    run_here([job for job in transferred if job.source is None], out)
    monkeypatch.setattr(job_runs, "train_scheduler", lambda *_: pytest.fail("trained anew"))
    run_here([job for job in transferred if job.source is not None], out)
    # The scheduler as it was saved, played there step by step.
    place = jobs["heat/fast-0"].config
    assert place.env.laser.ambient_k == (320.0, 325.0)
    envs = make_envs(place.env, "test", 2, "Disabled")
    scheduler = load_policy(out / "short" / "fast-0")
    front = read_result(out / "heat" / "fast-0").fronts["front"]
    assert front.prices == (0.02, 0.05, 0.1), "those of the study, and that of the place"
    for point, price in enumerate(front.prices):
        played = play_drives(scheduler, envs, drive_seeds(place.study, 2), price=price)
        assert played.returns_at(price).mean() == pytest.approx(
            front.returns[:, point].sum() / front.front.frames.sum()
        )
    # The rule is that of the source's validation drives, at each of these prices.
    rule = read_result(out / "heat" / "snr_threshold-0").fronts["front"]
    home = jobs["short/snr_threshold-0"].config
    study = home.study.model_copy(update={"families": ("snr_threshold",), "prices": front.prices})
    tuned = tune_families(home.model_copy(update={"study": study}))["snr_threshold"]
    assert rule.policies == tuple(str(tuned[price].policy) for price in front.prices)


def test_what_a_transfer_plays_depends_on_the_training_of_its_source(transferred):
    banks = {"short": "one", "heat": "two"}
    jobs = {job.name: job for job in transferred}
    told = jobs["heat/fast-0"].depends_on(banks)
    assert told["source"] == jobs["short/fast-0"].depends_on(banks)
    assert "source" not in jobs["heat/references-0"].depends_on(banks)


def test_a_transfer_of_what_has_not_been_trained_is_refused(files, transferred):
    out = files / "out"
    (job,) = (job for job in transferred if job.name == "heat/fast-0")
    with pytest.raises(ValueError, match="short/fast-0, which trains its scheduler, has no result"):
        run_here([job], out)


def test_what_goes_wrong_beside_the_workers_ends_them_at_once(files, monkeypatch):
    """And not only when nobody looks at the error any more."""
    ended = []

    def tasks(function, given, **_):
        try:
            yield next(given), ValueError("frame 3 is damaged")
        finally:
            ended.append(True)

    def full_disk(_):
        raise OSError("no space left on device")

    monkeypatch.setattr(job_runs, "run_tasks", tasks)
    monkeypatch.setattr(job_runs, "say", full_disk)
    with pytest.raises(OSError, match="no space left") as kept:
        job_runs.run_jobs(jobs_of(plan_of(files)), files / "out")
    assert ended and kept.tb is not None


def test_a_study_is_played_kept_and_measured(files, monkeypatch):
    plan, out = plan_of(files), files / "out"
    jobs = jobs_of(plan)
    run_here(jobs, out)
    # What stands is not run again.
    monkeypatch.setattr(job_runs, "run_job", lambda *_: pytest.fail("run again"))
    job_runs.run_jobs(jobs, out, workers=1)
    found = make_leaderboard(plan, jobs, out)
    json.dumps(found, allow_nan=False)
    table = found["presets"]["short"]
    assert set(table["rows"]) == {"fast", "linear", "random", "fixed", "no_heat"}
    assert table["ablations"] == ["no_heat"]
    assert table["best"] == min(
        set(table["rows"]) - {"no_heat"},
        key=lambda name: table["rows"][name]["error_at_half_energy"]["iqm"],
    )
    fast = table["rows"]["fast"]["return"]
    assert fast["low"] <= fast["iqm"] <= fast["high"] and len(fast["seeds"]) == 2
    assert table["kinds"]["fixed"] == "rule" and set(table["differences"]) | {table["best"]} == set(
        table["rows"]
    )
    families = table["groups"]["family"]
    assert sum(group["clips"] for group in families.values()) == table["clips"]
    # The return at the price of the preset is that of the point that was played at it.
    rows = table["fronts"]["fast"]
    assert fast["seeds"] == pytest.approx(
        [row["return"] for points in rows for row in points if row["price"] == table["price"]]
    )
    one, other = (table["improvement"][a][b] for a, b in (("fast", "fixed"), ("fixed", "fast")))
    assert one["probability"] + other["probability"] == pytest.approx(1.0)


def test_jobs_run_in_processes_and_a_failure_keeps_the_others(files, capsys):
    plan = plan_of(files, policies=["random"], ablations={}, seeds=[0])
    (references, random), out = jobs_of(plan), files / "out"
    # Where the folder of a job's result should be made there is a file.
    out.mkdir()
    (out / "blocked").write_text("")
    blocked = type(random)("blocked", "random", "random", random.config)
    with pytest.raises(ValueError, match="1 of 3 jobs failed, the others are kept: blocked/random"):
        job_runs.run_jobs([references, random, blocked], out, workers=2)
    assert "blocked/random-0 failed" in (told := capsys.readouterr().err)
    assert "; the others go on" in told
    assert set(read_result(out / references.name).fronts) == {"blind", "optimum"}
    played = read_result(out / random.name).fronts["front"]
    assert played.prices == (0.02, 0.09, 0.1) and set(played.policies) == {"random, seed 0"}


def test_what_is_played_elsewhere_waits_for_what_trains_it(transferred, tmp_path):
    order = job_runs._Order([job_runs.JobTask(job, tmp_path, {}) for job in transferred])
    tasks = order.tasks()
    first = [next(tasks) for _ in range(4)]
    assert {task.job.name for task in first} == {
        *(f"short/{row}-0" for row in ("references", "fast", "snr_threshold")),
        "heat/references-0",
    }
    assert next(tasks) is None
    trained = next(task for task in first if task.job.name == "short/fast-0")
    order.release(trained)
    assert next(tasks).job.name == "heat/fast-0" and next(tasks) is None
    order.release(next(task for task in first if task.job.name == "short/snr_threshold-0"))
    assert [task.job.name for task in tasks] == ["heat/snr_threshold-0"]


def test_a_learner_with_a_memory_is_a_job_like_the_others(files):
    ppo = {"total_steps": 32, "num_envs": 2, "rollout_steps": 8, "batch_size": 8, "drives": 2}
    agent = {"algorithm": "recurrent_ppo", "hidden": [4], "recurrent": {"units": 4}, "ppo": ppo}
    (files / "memory.yaml").write_text(yaml.safe_dump(agent))
    plan = plan_of(files, policies=[str(files / "memory.yaml")], ablations={}, seeds=[0])
    _, job = jobs_of(plan)
    run_here([job], files / "out")
    front = read_result(files / "out" / job.name).fronts["front"]
    assert front.prices == (0.02, 0.09, 0.1) and set(front.policies) == {"scheduler"}
    saved = plan_of(files, policies=[str(files / "out" / job.name)], ablations={}, seeds=[0])
    assert [job.kind for job in jobs_of(saved)] == ["references", "saved"]


def test_ctrl_c_says_what_is_kept(files, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    jobs = jobs_of(plan_of(files, policies=["random"], ablations={}, seeds=[0]))
    run_here(jobs[:1], files / "out")
    monkeypatch.setattr(job_runs, "run_tasks", interrupted)
    with pytest.raises(KeyboardInterrupt, match="1 of 2 jobs are kept; the same command continues"):
        job_runs.run_jobs(jobs, files / "out", workers=1)


@pytest.fixture
def result() -> JobResult:
    sums = np.arange(6.0).reshape(3, 2)
    front = PlayedFront(
        Front(sums, sums + 1, np.ones(3)),
        (0.1, 0.2),
        ("a", "b"),
        sums,
        sums,
        np.full((3, 2), np.nan),
    )
    return JobResult({"front": front}, 1.5, {"cool_eight_m": np.ones(3)})


def test_results_are_read_as_they_were_written(tmp_path, result):
    write_result(tmp_path / "p" / "a-0", result, {"seed": (1, 2)})
    again = read_result(tmp_path / "p" / "a-0")
    front, before = again.fronts["front"], result.fronts["front"]
    assert (front.prices, front.policies) == (before.prices, before.policies)
    np.testing.assert_array_equal(front.front.energy, before.front.energy)
    np.testing.assert_array_equal(front.temperature_k, before.temperature_k)
    np.testing.assert_array_equal(again.arrays["cool_eight_m"], np.ones(3))
    assert stands(tmp_path / "p" / "a-0", {"seed": (1, 2)})
    assert not stands(tmp_path / "p" / "b-0", {"seed": (1, 2)})


def test_results_of_another_config_or_schema_are_refused_and_kept(tmp_path, result):
    stem = tmp_path / "a-0"
    write_result(stem, result, {"seed": 1, "drives": 2})
    before = stem.with_suffix(".json").read_text()
    with pytest.raises(ValueError, match=r"another configuration \(seed differ\)"):
        stands(stem, {"seed": 2, "drives": 2})
    assert stem.with_suffix(".json").read_text() == before
    stem.with_suffix(".json").write_text(before.replace('"schema": 1', '"schema": 99'))
    with pytest.raises(ValueError, match="has schema 99, but this version reads 1"):
        stands(stem, {"seed": 1, "drives": 2})
    stem.with_suffix(".json").write_text("{")
    with pytest.raises(ValueError, match="missing or damaged"):
        stands(stem, {"seed": 1, "drives": 2})


def test_damaged_arrays_are_told_by_file(tmp_path, result):
    stem = tmp_path / "a-0"
    write_result(stem, result, {})
    stem.with_suffix(".npz").write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(ValueError, match=r"a-0\.npz is missing or damaged"):
        read_result(stem)
