"""A scheduler and what it is compared with on recordings: what can be played, and what is known."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, Final

import numpy as np

from agents.config import DemoConfig, StudyConfig
from agents.evaluation import (
    FIXED_POLICIES,
    PACKAGES,
    PlayedDrives,
    check_study,
    drive_seeds,
    make_envs,
    play_drives,
    play_optimum,
    price_of,
    ratio,
    study_interval,
    tune_families,
    without_tuning,
)
from agents.optimum import clips_of, drive_of, frames_of
from agents.policies import Policy, RandomPolicy, Scheduler
from shotenv.decision import Problem, open_problem
from unwrap.signal import Shots
from unwrap.support import progress

SCHEDULER, OPTIMUM = "scheduler", "optimum"
LEAST_CLIPS: Final = 2
"""Of which intervals are told."""


def problem_judged(config: DemoConfig) -> Problem:
    """The problem of the drives that policies are judged on."""
    return open_problem(config.env.model_copy(update={"split": config.study.split}))


def tells_less(config: DemoConfig) -> bool:
    """Whether the recordings of an experiment tell too little for fronts of error against energy.

    They have no reference, or no eight samples to compare with, or drives pass one clip alone.
    """
    problem = problem_judged(config)
    bank = problem.bank
    if not bank.is_recorded:
        return False
    short = bank.truth_level != "external" or Shots.EIGHT not in bank.answers
    return short or clips_passed(problem, config.study) < LEAST_CLIPS


def clips_passed(problem: Problem, study: StudyConfig) -> int:
    """Number of clips that the drives of a study pass."""
    drives = [drive_of(problem, seed) for seed in drive_seeds(study, study.drives)]
    return len(np.unique(clips_of(problem, frames_of(drives))))


def evaluate_recordings(
    config: DemoConfig, scheduler: Scheduler
) -> tuple[dict[str, Any], dict[str, PlayedDrives]]:
    """Judge `scheduler` on recordings by returns and energies, and by errors as far as known.

    Every policy chooses among what is answered: in place of other samples it takes fewer, and the
    scheduler what it scores highest of the rest.

    Returns
    -------
    results : dict
        The content of `results.json`: "truth", "left_out" (what cannot be played or told, and
        why), "policies" by name, and what of.
    played : dict of str to PlayedDrives

    Raises
    ------
    ValueError
        The scheduler was trained on other features than the environment has.
    """
    check_study(config, scheduler)
    study, problem = config.study, problem_judged(config)
    answers, level = problem.bank.answers, problem.bank.truth_level
    left_out = [
        f"always {shots:d} DCS: recordings have {int(max(answers))} samples; policies that ask for "
        f"{shots:d} take the most there are"
        for shots in Shots
        if shots not in answers
    ]
    rules: dict[str, Policy] = {}
    if (why := without_tuning(problem)) is not None:
        left_out.append(why)
    else:
        tuned = tune_families(config)
        rules = {name: found[price_of(config.env)].policy for name, found in tuned.items()}
    policies: dict[str, Policy] = {
        SCHEDULER: scheduler,
        **rules,
        "random": RandomPolicy(study.seed),
        **{name: FIXED_POLICIES[name] for name in (f"always_{shots:d}" for shots in answers)},
    }
    envs = make_envs(config.env, study.split, study.drives, "Disabled")
    seeds = drive_seeds(study, study.drives)
    played = {}
    with progress(len(policies), f"policies on {study.split} drives", "policy") as bar:
        for name, policy in policies.items():
            played[name] = play_drives(policy, envs, seeds)
            bar.update(1)
    if level == "none":
        left_out.append("optimum: without a reference fewest samples are always best")
    elif (best := play_optimum(problem, seeds)) is None:
        left_out.append("optimum: not known with a laser that is derated")
    else:
        played[OPTIMUM] = best
    results = {
        "recordings": True,
        "truth": level,
        "answers": [int(shots) for shots in answers],
        "left_out": left_out,
        "scheduler": SCHEDULER,
        "policies": {
            name: {
                **measures_of(one, study),
                "rule": str(rules[name]) if name in rules else None,
            }
            for name, one in played.items()
        },
        "drives": len(seeds),
        "clips": clips_passed(problem, study),
        "seeds": list(seeds),
        "confidence": study.confidence,
        "versions": {name: version(name) for name in PACKAGES},
        "algorithm": scheduler.provenance.algorithm,
        "config": config.model_dump(mode="json"),
    }
    return results, played


def measures_of(one: PlayedDrives, study: StudyConfig) -> dict[str, Any]:
    """Means over drives, each with its interval over clips where there are several."""
    found: dict[str, Any] = {"shots_share": one.shots_share()}
    for name, (total, count) in one.per_clip().items():
        found[name] = mean_told(total, count, study)
    return found


def mean_told(
    total: np.ndarray, count: np.ndarray, study: StudyConfig
) -> Mapping[str, float | None] | None:
    """Mean of what adds up to `total` [C] in `count` [C] frames of each clip; None of no frame.

    Without an interval, "low" and "high" None, where it is known of a single clip.
    """
    there = count > 0
    if not there.any():
        return None
    if np.count_nonzero(there) < LEAST_CLIPS:
        return {"mean": float(total.sum() / count.sum()), "low": None, "high": None}
    return study_interval(ratio, study, total[there], count[there]).named("mean")
