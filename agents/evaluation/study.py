"""The study: a scheduler and what it is compared with, on the same test drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from agents.config import DemoConfig
from agents.evaluation.play import (
    FIXED_POLICIES,
    PlayedDrives,
    drive_seeds,
    make_envs,
    play_drives,
)
from agents.evaluation.summary import summary
from agents.optimum import best_rule, tabulate
from agents.policies import (
    CyclePolicy,
    NetworkPolicy,
    Policy,
    RandomPolicy,
    SnrThresholdPolicy,
)
from shotenv.decision import FEATURE_NAMES, open_problem
from unwrap.support import progress

SCHEDULER: Final = "ppo"
RULES: Final = ("snr_threshold", "cycle")
"""Baselines that the report puts into words."""


@dataclass(frozen=True)
class Evaluation:
    """What came of a study.

    Attributes
    ----------
    results : dict
        Means, differences in pairs and their intervals: the content of `results.json`.
    played : dict of str to PlayedDrives
        The test drives under each policy.
    """

    results: dict[str, Any]
    played: dict[str, PlayedDrives]


def tune_rule(config: DemoConfig) -> SnrThresholdPolicy:
    """The one-threshold rule with the best return on validation drives."""
    problem = open_problem(config.env.model_copy(update={"split": "validation"}))
    seeds = drive_seeds(config.study, config.study.tuning_drives)
    frames = len(seeds) * config.env.frames_per_drive
    with progress(frames, "tuning the threshold rule", "frame") as bar:
        possible = tabulate(problem, seeds, tick=bar.update)
    rule = best_rule(possible.table())
    # Shots here, actions there: a policy is told what it takes, a table is indexed.
    below, above = rule.shots
    return SnrThresholdPolicy(FEATURE_NAMES, rule.limit, below=below, above=above)


def baselines(config: DemoConfig) -> dict[str, Policy]:
    """What a scheduler is compared with; the rule is tuned here."""
    return {
        "snr_threshold": tune_rule(config),
        "cycle": CyclePolicy(4, shots=8, otherwise=2),  # assumed: 3.5 samples a frame
        "random": RandomPolicy(config.study.seed),
        **FIXED_POLICIES,
    }


def play_all(config: DemoConfig, policies: Mapping[str, Policy]) -> dict[str, PlayedDrives]:
    """Every policy on the same test drives."""
    seeds = drive_seeds(config.study, config.study.drives)
    # The same environments for all, which remember what they measured: noise depends on drive and
    # frame alone, so that policies that take the same shots of a frame share its cost.
    envs = make_envs(config.env, config.study.split, len(seeds), "Disabled")
    frames = len(policies) * len(seeds) * config.env.frames_per_drive
    with progress(frames, f"evaluating on {config.study.split} drives", "frame") as bar:
        return {
            name: play_drives(policy, envs, seeds, tick=bar.update)
            for name, policy in policies.items()
        }


def evaluate_scheduler(config: DemoConfig, scheduler: NetworkPolicy) -> Evaluation:
    """Judge `scheduler` beside the baselines; nothing is written.

    Raises
    ------
    ValueError
        The scheduler was trained on other features than the environment has.
    """
    if scheduler.feature_names != FEATURE_NAMES:
        raise ValueError(
            "the scheduler was trained on other features than this environment has; "
            "train it again (`shotenv train`)"
        )
    policies = {SCHEDULER: scheduler, **baselines(config)}
    played = play_all(config, policies)
    results = summary(played, config.study, scheduler=SCHEDULER)
    for name in RULES:
        results["policies"][name]["rule"] = str(policies[name])
    problem = open_problem(config.env.model_copy(update={"split": config.study.split}))
    # Every how many pixels each way: only of all of them there are images.
    results["every"] = problem.bank.every
    results["config"] = config.model_dump(mode="json")
    return Evaluation(results, played)
