"""The study: a scheduler and what it is compared with, on the same test drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from gymnasium.vector import VectorEnv

from agents.config import DemoConfig, StudyConfig
from agents.evaluation.budget import Plays, check_budget, judge_budget
from agents.evaluation.front_measures import BLIND, OPTIMUM, compare_fronts
from agents.evaluation.play import (
    FIXED_POLICIES,
    PlayedDrives,
    drive_seeds,
    make_envs,
    play_drives,
)
from agents.evaluation.price_sweep import (
    MIXTURES,
    PlayedFront,
    optimum_front,
    play_blind,
    play_front,
    prices_of,
)
from agents.evaluation.summary import summary
from agents.evaluation.tuning import Tuned, tune, tuning_envs
from agents.optimum import by_clip, tabulate, tabulate_temporal_errors
from agents.policies import (
    FAMILIES_OF_PRACTICE,
    Policy,
    PolicyFamily,
    RandomPolicy,
    Scheduler,
)
from shotenv.config import EnvConfig
from shotenv.decision import FEATURE_NAMES, Problem, open_problem
from unwrap.signal import Shots
from unwrap.support import progress, say

SCHEDULER: Final = "scheduler"
TOLD: Final = 6
"""Most differences that a warning tells."""


@dataclass(frozen=True)
class Evaluation:
    """What came of a study.

    Attributes
    ----------
    results : dict
        Fronts, means, differences in pairs and their intervals: the content of `results.json`.
    played : dict of str to PlayedDrives
        The test drives under each policy, at the price that each drive has.
    at_prices : list of PlayedDrives
        Those of the scheduler's front: the same drives, once at each of its prices.
    """

    results: dict[str, Any]
    played: dict[str, PlayedDrives]
    at_prices: list[PlayedDrives]


def families_of(study: StudyConfig) -> list[PolicyFamily]:
    """The families that a study names.

    Raises
    ------
    ValueError
        There is none of a name.
    """
    known = {family.name: family for family in FAMILIES_OF_PRACTICE}
    for name in study.families:
        if name not in known:
            raise ValueError(f"families has {name!r}; expected of {', '.join(known)}")
    return [known[name] for name in study.families]


def price_of(config: EnvConfig) -> float:
    """The middle of the prices that drives have: their geometric mean."""
    low, high = config.reward.power
    return low if low == high else float(np.sqrt(low * high))  # rounding would make it another


def without_tuning(problem: Problem) -> str | None:
    """Why no rule can be tuned on the problem's bank, where that is so: a sentence, or None."""
    bank = problem.bank
    if any(clip.split == "validation" for clip in bank.clips):
        return None
    return f"tuned rules: bank {bank.name} has no validation clips to tune them on"


def tune_families(config: DemoConfig) -> dict[str, dict[float, Tuned]]:
    """Each family's best at each price of the study, and at that of the drives.

    Tuned on validation drives: judged on the drives that chose it, a rule would look too good.
    """
    study = config.study
    prices = sorted({*study.prices, price_of(config.env)})
    seeds = drive_seeds(study, study.tuning_drives)
    envs = tuning_envs(config.env, len(seeds))
    tuned = tune(families_of(study), envs, seeds, prices)
    return {name: {one.price: one for one in found} for name, found in tuned.items()}


def play_all(
    policies: Mapping[str, Policy], envs: VectorEnv, study: StudyConfig
) -> dict[str, PlayedDrives]:
    """Every policy on the same drives, each at the drive's own price."""
    seeds = drive_seeds(study, study.drives)
    unwrapped: Any = envs.unwrapped  # gymnasium's annotation does not know our attributes
    problem = unwrapped.problem
    frames = len(seeds) * problem.config.frames_per_drive
    with progress(frames, f"pairs of actions on {study.split} drives", "frame") as bar:
        temporal_errors = tabulate_temporal_errors(problem, seeds, tick=bar.update)
    with progress(len(policies), f"policies on {study.split} drives", "policy") as bar:
        played = {}
        for name, policy in policies.items():
            one = play_drives(policy, envs, seeds)
            played[name] = one.with_temporal_errors(temporal_errors)
            bar.update(1)
        return played


def play_fronts(
    scheduler: Scheduler,
    tuned: Mapping[str, Mapping[float, Tuned]],
    envs: VectorEnv,
    config: DemoConfig,
) -> tuple[dict[str, PlayedFront], list[PlayedDrives]]:
    """Fronts of the scheduler, of the tuned families and of blind choices, on the test drives.

    The second are the scheduler's drives at each of its prices.
    """
    study, own_drives = config.study, list[PlayedDrives]()
    seeds = drive_seeds(study, study.drives)
    own = prices_of(scheduler, study.prices) or (price_of(config.env),)
    points = len(own) + len(tuned) * len(study.prices) + len(FIXED_POLICIES) + len(MIXTURES)
    with progress(points, f"fronts on {study.split} drives", "point") as bar:
        fronts = {
            SCHEDULER: play_front(
                lambda price: scheduler,
                envs,
                seeds,
                own,
                names=lambda policy: SCHEDULER,
                keep=own_drives.append,
                tick=bar.update,
            )
        }
        for name, of_price in tuned.items():
            fronts[name] = play_front(
                lambda price, of_price=of_price: of_price[price].policy,  # type: ignore[misc]
                envs,
                seeds,
                study.prices,
                tick=bar.update,
            )
        fronts[BLIND] = play_blind(envs, seeds, tick=bar.update)
        return fronts, own_drives


def evaluate_scheduler(
    config: DemoConfig, scheduler: Scheduler, *, budget_j: float | None = None
) -> Evaluation:
    """Judge `scheduler` beside the policies of practice and the optimum; nothing is written.

    Parameters
    ----------
    config : DemoConfig
    scheduler : Scheduler
    budget_j : float, optional
        Laser energy per drive on average, J, with which all are judged, too.

    Raises
    ------
    ValueError
        The scheduler was trained on other features than the environment has, or with none of the
        prices; the study names a family that there is none of; or no choice spends the budget.
    """
    study = config.study
    check_study(config, scheduler)
    warn_of_prices(config, scheduler)
    warn_of_environment(config.env, scheduler)
    # The same environments for all, which remember what they measured: noise depends on drive and
    # frame alone, so that policies that take the same shots of a frame share its cost.
    envs = make_envs(config.env, study.split, study.drives, "Disabled")
    plays = Plays(envs, drive_seeds(study, study.drives))
    if budget_j is not None:
        check_budget(budget_j, plays)
    # Simulated banks have all splits; recordings may not.
    problem = open_problem(config.env.model_copy(update={"split": study.split}))
    untuned = without_tuning(problem)
    tuned = {} if untuned else tune_families(config)
    rules = {name: found[price_of(config.env)].policy for name, found in tuned.items()}
    policies = {
        SCHEDULER: scheduler,
        **rules,
        "random": RandomPolicy(study.seed),
        **FIXED_POLICIES,
    }
    played = play_all(policies, envs, study)
    fronts, own_drives = play_fronts(scheduler, tuned, envs, config)
    optimum, cool_eight_m = table_fronts(problem, study)

    results = summary(played, study, scheduler=SCHEDULER, drive_s=drive_s(config.env))
    for name, rule in rules.items():
        results["policies"][name]["rule"] = str(rule)
    blind = fronts.pop(BLIND)
    results["answer"] = {
        "scheduler": SCHEDULER,
        "prices": list(fronts[SCHEDULER].prices),
        **compare_fronts(fronts, blind, optimum, cool_eight_m, study, scheduler=SCHEDULER),
    }
    shown = {**fronts, BLIND: blind} | ({OPTIMUM: optimum} if optimum else {})
    results["fronts"] = {name: front.rows for name, front in shown.items()}
    if budget_j is not None:
        results["budget"] = judge_budget(budget_j, config, scheduler, tuned, plays)
    results["recorded"] = problem.bank.is_recorded
    results["truth"] = problem.bank.truth_level
    results["left_out"] = [untuned] if untuned else []
    results["algorithm"] = scheduler.provenance.algorithm
    # Every how many pixels each way: only of all of them there are images.
    results["every"] = problem.bank.every
    results["config"] = config.model_dump(mode="json")
    return Evaluation(results, played, own_drives)


def table_fronts(problem: Problem, study: StudyConfig) -> tuple[PlayedFront | None, np.ndarray]:
    """From the outcomes of every action: the optimum, and the error of 8 DCS without heat.

    Returns
    -------
    optimum : PlayedFront or None
        None with a derated laser: what it would measure depends on the choices before, which no
        table tells.
    cool_eight_m : float64 [C]
        Sum over the frames of each clip of the error of 8 DCS with a laser that never trips.
    """
    seeds = drive_seeds(study, study.drives)
    frames = len(seeds) * problem.config.frames_per_drive
    with progress(frames, f"every action on {study.split} drives", "frame") as bar:
        possible = tabulate(problem, seeds, tick=bar.update)
    eight_m = possible.table().depth_mae_m[..., Shots.EIGHT.action]
    derated = problem.config.laser.derate_per_k > 0
    optimum = None if derated else optimum_front(possible, study.prices)
    return optimum, by_clip(eight_m, possible.clips())


def check_study(config: DemoConfig, scheduler: Scheduler) -> None:
    """Refuse what cannot be judged, before anything is played.

    Raises
    ------
    ValueError
        See `evaluate_scheduler`.
    """
    families_of(config.study)
    if scheduler.feature_names != FEATURE_NAMES:
        raise ValueError(
            "the scheduler was trained on other features than this environment has; "
            "train it again (`shotenv train`)"
        )
    prices_of(scheduler, config.study.prices)


def warn_of_prices(config: DemoConfig, scheduler: Scheduler) -> None:
    """Say which prices the scheduler was not trained for, and that it has no knob."""
    if scheduler.provenance.power_price is None:
        return
    low, high = scheduler.provenance.power_price
    left = [price for price in config.study.prices if not low <= price <= high]
    if low == high:
        say(f"the scheduler was trained at one price, {low:g}: its front is one point")
    elif left:
        say(
            f"not played: prices {', '.join(f'{price:g}' for price in left)}; the scheduler was "
            f"trained with {low:g} to {high:g}"
        )
    least, most = config.env.reward.power
    if least < low or most > high:
        say(
            f"reward.power is {least:g} to {most:g}, outside of {low:g} to {high:g}, which the "
            "scheduler was trained with: expect less of it in the table of policies"
        )


def warn_of_environment(env: EnvConfig, scheduler: Scheduler) -> None:
    """Say in what the environment differs from that of the training, where that is known."""
    trained = scheduler.provenance.environment
    # Prices are warned of elsewhere, and splits always differ.
    now, then = (
        {name: value for name, value in _flat(one).items() if name not in ("split", "reward.power")}
        for one in (env.model_dump(mode="json"), trained)
    )
    # What only one of them has is of another version, not of another sensor.
    others = [name for name in now if name in then and now[name] != then[name]]
    if others:
        told = "; ".join(f"{name} {now[name]} (trained: {then[name]})" for name in others[:TOLD])
        more = f"; and {len(others) - TOLD} more" if len(others) > TOLD else ""
        say(f"the scheduler was trained in another environment: {told}{more}")


def _flat(section: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Fields of nested sections by their dotted names."""
    found: dict[str, Any] = {}
    for name, value in section.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = value
    return found


def drive_s(config: EnvConfig) -> float:
    """How long a drive takes, seconds."""
    return config.frames_per_drive / config.frame_rate_hz
