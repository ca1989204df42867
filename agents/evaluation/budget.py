"""A budget of laser energy: every family with its knob where it is spent, beside the optimum.

Where a knob has to stand is found on validation drives. What is told was played on test drives with
the knob there: drives differ in their laser's power, so that the budget is met on average, and only
about.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from gymnasium.vector import VectorEnv

from agents.config import DemoConfig, StudyConfig
from agents.evaluation.play import (
    FIXED_POLICIES,
    PlayedDrives,
    drive_seeds,
    make_envs,
    play_drives,
)
from agents.evaluation.price_sweep import MIXTURES, prices_of
from agents.evaluation.statistics import ratio, study_interval
from agents.evaluation.tuning import Tuned
from agents.optimum import MOST_TRIED, Front, bracket, by_clip, constrained_optimum, tabulate
from agents.policies import Action, Observation, Policy, Scheduler
from shotenv.decision import open_problem
from unwrap.support import progress

ONCE: Final = np.ones(1)
LEAST_SHARE: Final = 1e-9


class Setting(NamedTuple):
    """A policy, the price of power that it is told, and how it is called.

    Attributes
    ----------
    policy : Policy
    price : float, optional
        None: of no matter to the policy.
    words : str
    """

    policy: Policy
    price: float | None
    words: str


class Part(NamedTuple):
    """A setting and the share of drives that it plays; which they are is drawn by lot."""

    share: float
    setting: Setting


class Plays:
    """Settings played on the drives `seeds`, each once."""

    def __init__(self, envs: VectorEnv, seeds: Sequence[int]) -> None:
        self._envs, self._seeds = envs, seeds
        self._played: dict[tuple[int, float | None], tuple[Policy, PlayedDrives]] = {}

    def of(self, setting: Setting) -> PlayedDrives:
        """The drives under a setting."""
        policy, price = setting.policy, setting.price
        key = id(policy), price if policy.reads_price else None
        if key not in self._played:
            # The policy is kept, too: the identity of one that is gone may come again.
            self._played[key] = policy, play_drives(policy, self._envs, self._seeds, price=price)
        return self._played[key][1]

    def energy_j(self, setting: Setting) -> float:
        """Mean laser energy of a drive."""
        return float(self.of(setting).per_drive["laser_energy_j"].mean())


FIXED: Final = tuple(Setting(policy, None, name) for name, policy in FIXED_POLICIES.items())
BLIND: Final = (*FIXED, *(Setting(policy, None, name) for name, policy in MIXTURES.items()))


def check_budget(budget_j: float, plays: Plays) -> tuple[float, float]:
    """Least and most that the drives can be made to spend on average, J.

    Raises
    ------
    ValueError
        The budget is not between them.
    """
    least, most = (plays.energy_j(one) for one in (FIXED[0], FIXED[-1]))
    # Written so that NaN is refused, too.
    if not least <= budget_j <= most:
        raise ValueError(
            f"budget is {budget_j:g} J; expected {least:.4g} to {most:.4g} J, what always 2 and "
            "always 8 DCS spend of laser energy per drive on average"
        )
    return least, most


def judge_budget(
    budget_j: float,
    config: DemoConfig,
    scheduler: Scheduler,
    tuned: Mapping[str, Mapping[float, Tuned]],
    test: Plays,
) -> dict[str, Any]:
    """What each family reaches that spends `budget_j` of laser energy per drive on average.

    Parameters
    ----------
    budget_j : float
        Checked by `check_budget`.
    config : DemoConfig
    scheduler : Scheduler
        Its knob is turned within the prices that it was trained with.
    tuned : mapping
        Of each family of practice the best at each price: the two neighbours are mixed whose
        energies the budget lies between, or one of them and a fixed choice.
    test : Plays
        Of the test drives.

    Returns
    -------
    dict
        "budget_j"; "possible_j"; "policies": by name that of `measured`; "optimum": its prices of a
        joule and the same, where it can be computed.
    """
    study = config.study
    seeds = drive_seeds(study, study.tuning_drives)
    range_m = config.env.sensor.max_range_m
    validation = Plays(make_envs(config.env, "validation", len(seeds), "Disabled"), seeds)
    found: dict[str, list[Part]] = {}
    with progress(len(tuned) + 2, f"budget of {budget_j:g} J", "family") as bar:
        found["scheduler"] = scheduler_parts(scheduler, config, budget_j, validation)
        bar.update(1)
        for name, of_price in tuned.items():
            rules = [Setting(one.policy, price, str(one.policy)) for price, one in of_price.items()]
            found[name] = mixed((*FIXED, *rules), budget_j, validation, range_m)
            bar.update(1)
        found["blind"] = mixed(BLIND, budget_j, validation, range_m)
        bar.update(1)
    told: dict[str, Any] = {
        "budget_j": budget_j,
        "possible_j": check_budget(budget_j, test),
        "policies": {},
    }
    best = None if config.env.laser.derate_per_k else optimum_parts(budget_j, config)
    if best:
        parts, prices_per_j = best
        against = [(part.share, test.of(part.setting)) for part in parts]
        told["optimum"] = {
            "prices_per_j": prices_per_j,
            **measured(against, None, budget_j, study, range_m),
        }
    for name, parts in found.items():
        played = [(part.share, test.of(part.setting)) for part in parts]
        told["policies"][name] = {
            "setting": [
                {"share": part.share, "price": part.setting.price, "policy": part.setting.words}
                for part in parts
            ],
            "validation_energy_j": sum(p.share * validation.energy_j(p.setting) for p in parts),
            **measured(played, against if best else None, budget_j, study, range_m),
        }
    return told


def scheduler_parts(
    scheduler: Scheduler, config: DemoConfig, budget_j: float, validation: Plays
) -> list[Part]:
    """The scheduler at the price at which it just spends no more than the budget.

    Where no price of its training does, or all do, it is mixed with a fixed choice.
    """
    own = prices_of(scheduler, config.study.prices)
    low, high = scheduler.provenance.power_price or (None, None)
    if len(own) < 2 or low is None or high is None:
        # No knob: the one price that it was trained at, or that of the drives.
        low = high = own[0] if own else float(np.sqrt(np.prod(config.env.reward.power)))

    def at(price: float) -> Setting:
        return Setting(scheduler, price, "scheduler")

    near, dear = bracket(lambda price: validation.energy_j(at(price)), budget_j, low, high)
    if near < dear:
        return [Part(1.0, at(dear))]
    return mixed((*FIXED, at(dear)), budget_j, validation, config.env.sensor.max_range_m)


def mixed(settings: Sequence[Setting], budget_j: float, plays: Plays, range_m: float) -> list[Part]:
    """One setting, or the mixture of two, that errs least of those that spend the budget.

    Mixtures are of drives, some played as the one and the others as the other, so that what they
    reach on average follows from what each reaches.
    """
    played = [plays.of(one) for one in settings]
    front = Front(
        np.array([[plays.energy_j(one) for one in settings]]),
        np.array([[error_m(one, range_m).mean() for one in played]]),
        ONCE,
    )
    shares = front.mixture_spending(budget_j, ONCE)
    return [
        Part(float(share), setting)
        for share, setting in zip(shares, settings, strict=True)
        if share > LEAST_SHARE
    ]


class Replay(Policy):
    """Actions [N, T] that were chosen before; 2 DCS in frames without laser, -1."""

    def __init__(self, actions: np.ndarray) -> None:
        self._actions, self._frame = np.maximum(actions, 0), 0

    def act(self, observation: Observation, info: Mapping[str, Any] | None = None) -> Action:
        """The next frame's actions."""
        self._frame += 1
        return self._actions[:, self._frame - 1]

    def reset(self) -> None:
        """Begin with the first frame."""
        self._frame = 0


def optimum_parts(budget_j: float, config: DemoConfig) -> tuple[list[Part], tuple[float, float]]:
    """The constrained optimum of the test drives, to be played, and its prices of a joule."""
    study = config.study
    seeds = drive_seeds(study, study.drives)
    problem = open_problem(config.env.model_copy(update={"split": study.split}))
    frames = len(seeds) * config.env.frames_per_drive
    with progress(frames, f"every action on {study.split} drives", "frame") as bar:
        possible = tabulate(problem, seeds, tick=bar.update)
    with progress(MOST_TRIED, "prices of a joule", "price") as bar:
        best = constrained_optimum(possible, budget_j, tick=bar.update)
    parts = [
        Part(share, Setting(Replay(played.actions), None, "dynamic programming"))
        for share, played in zip(best.shares, best.played, strict=True)
        if share > LEAST_SHARE
    ]
    return parts, best.prices_per_j


Mixture = Sequence[tuple[float, PlayedDrives]]
"""The same drives as they were played, and the share of them that is."""


def measured(
    played: Mixture,
    optimum: Mixture | None,
    budget_j: float,
    study: StudyConfig,
    range_m: float,
) -> dict[str, Any]:
    """What came of the drives on average over who plays which.

    Returns
    -------
    dict
        "laser_energy_j", per drive, and "depth_mae_m", with their intervals over clips, where a
        frame without laser misses the whole range; "worst_drive_j", the most energy of any drive;
        "drives_over_share". With an optimum "above_optimum_m", by how much the error is more, and
        "below_optimum_return", by how much the return per drive is less with power for nothing,
        which is what the optimum makes most of.
    """
    frames = by_clip(np.ones(played[0][1].clip.shape), played[0][1].clip)

    def mean(values: Any, less: Any = None) -> Any:
        """Interval of the mean of what drives were in each frame, less that of another."""
        total = summed(played, values)
        total = total if less is None else total - summed(less, values)
        return study_interval(ratio, study, total, frames)

    def depth_m(one: PlayedDrives) -> np.ndarray:
        return error_m(one, range_m)

    per_drive = [(share, one.per_drive["laser_energy_j"]) for share, one in played]
    told = {
        "laser_energy_j": mean(lambda one: per_frame(one, one.laser_energy_j)).named("mean"),
        "worst_drive_j": max(float(energy_j.max()) for _, energy_j in per_drive),
        "drives_over_share": sum(
            share * float((energy_j > budget_j).mean()) for share, energy_j in per_drive
        ),
        "depth_mae_m": mean(depth_m).named("mean"),
    }
    if optimum is None:
        return told
    apart = mean(lambda one: -per_frame(one, one.rewards_at(0.0)), optimum)
    return told | {
        "above_optimum_m": mean(depth_m, optimum).named("difference"),
        "below_optimum_return": apart.named("difference"),
    }


def summed(played: Mixture, values: Any) -> np.ndarray:
    """Sums [C] over the frames of each clip of `values` [N, T] of drives, in their shares."""
    return np.sum([share * by_clip(values(one), one.clip) for share, one in played], axis=0)


def per_frame(one: PlayedDrives, values: np.ndarray) -> np.ndarray:
    """What adds up over a drive, so that its mean over frames is the drive's."""
    return values.shape[1] * values


def error_m(one: PlayedDrives, range_m: float) -> np.ndarray:
    """Depth error of each frame, m; without laser there is no depth."""
    return np.where(one.shots > 0, one.depth_mae_m, range_m)
