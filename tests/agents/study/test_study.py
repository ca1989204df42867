"""A whole study on the tiny bank: jobs, what is kept of them, what is refused, and the table."""

import json

import numpy as np
import pytest
import yaml

from agents.cli.entry import main
from agents.config.study_plan import StudyPlan
from agents.evaluation.price_sweep import PlayedFront
from agents.optimum.fronts import Front
from agents.study import job_runs
from agents.study.job_results import JobResult, read_result, stands, write_result
from agents.study.jobs import jobs_of
from agents.study.leaderboard import make_leaderboard
from shotenv.config.env import EnvConfig
from shotenv.config.reader import ConfigError, configs_dir, read_config

FAST = {
    "algorithm": "regression",
    "power_price": [0.01, 0.2],
    "hidden": [4],
    "regression": {
        **{"rounds": 1, "drives": 2, "validation_drives": 2, "horizon": 1},
        **{"members": 1, "passes": 1},
    },
}


@pytest.fixture
def files(tmp_path, tiny_kwargs):
    """A preset and two learners, as YAML files."""
    shipped = read_config(EnvConfig, configs_dir() / "env" / "default.yaml")
    env = shipped.model_dump(mode="json") | tiny_kwargs | {"frames_per_drive": 8}
    for name, content in {"short": env, "fast": FAST, "linear": {**FAST, "hidden": []}}.items():
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return tmp_path


def plan_of(files, **changes):
    fields = {
        "policies": [str(files / "fast.yaml"), str(files / "linear.yaml"), "random", "fixed"],
        "presets": [str(files / "short.yaml")],
        "seeds": [0, 1],
        "ablations": {
            "no_heat": {
                "policy": str(files / "fast.yaml"),
                "unseen": ["temperature", "heat_margin"],
                "presets": [str(files / "short.yaml")],
            }
        },
        "study": {"drives": 2, "tuning_drives": 2, "prices": [0.02, 0.1], "bootstrap_draws": 100},
    }
    return StudyPlan.model_validate(fields | changes)


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
    # References and fifteen rules once; five learners and random with each seed; three ablations.
    assert len(jobs) == 5 * (1 + 15 + 6 * len(plan.seeds)) + 3 * len(plan.seeds)


def run_here(jobs, folder):
    """Every job, in this process."""
    for job in jobs:
        job_runs.run_job(job, folder, job.depends_on(job_runs.bank_of(job.config.env)))


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
    assert table["best"] == min(
        table["rows"], key=lambda name: table["rows"][name]["error_at_half_energy"]["iqm"]
    )
    fast = table["rows"]["fast"]["return"]
    assert fast["low"] <= fast["iqm"] <= fast["high"] and len(fast["seeds"]) == 2
    # The return at the price of the preset is that of the point that was played at it.
    rows = table["fronts"]["fast"]
    assert fast["seeds"] == pytest.approx(
        [row["return"] for points in rows for row in points if row["price"] == table["price"]]
    )
    one, other = (table["improvement"][a][b] for a, b in (("fast", "fixed"), ("fixed", "fast")))
    assert one["probability"] + other["probability"] == pytest.approx(1.0)


def test_jobs_run_in_processes_and_a_failure_keeps_the_others(files):
    plan = plan_of(files, policies=["random"], ablations={}, seeds=[0])
    (references, random), out = jobs_of(plan), files / "out"
    # Where the folder of a job's result should be made there is a file.
    out.mkdir()
    (out / "blocked").write_text("")
    blocked = type(random)("blocked", "random", "random", random.config)
    with pytest.raises(ValueError, match="1 of 3 jobs failed, the others are kept: blocked/random"):
        job_runs.run_jobs([references, random, blocked], out, workers=2)
    assert set(read_result(out / references.name).fronts) == {"blind", "optimum"}
    assert read_result(out / random.name).fronts["front"].prices == (0.02, 0.09, 0.1)


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
    def interrupted(*_):
        raise KeyboardInterrupt

    jobs = jobs_of(plan_of(files, policies=["random"], ablations={}, seeds=[0]))
    run_here(jobs[:1], files / "out")
    monkeypatch.setattr(job_runs, "as_completed", interrupted)
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
