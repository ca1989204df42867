"""How much there is to win in the decision problem: the clairvoyant optimum against simple rules.

Cost is minus the return; excess is how much more than the optimum a policy costs over all drives.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from agents.config import DemoConfig, StudyConfig
from agents.evaluation.statistics import excess, mean, study_interval
from agents.optimum import (
    DriveTable,
    PlayedTable,
    Possible,
    always,
    best_choice,
    best_rule,
    blind_choices,
    clairvoyant,
    greedy,
    play,
    threshold,
)
from shotenv.config import LaserConfig, RewardConfig
from unwrap.signal import Shots

# Assumed: what there must be to gain for learning a scheduler to be worth its while.
GOALS: Final = {
    "best_fixed": 0.15,
    "best_blind": 0.12,
    "threshold_rule": 0.05,
    "greedy": 0.05,
}
"""Least excess over the optimum of each kind of policy, for the problem to be worth solving."""
LEAST_SHARE: Final = 0.10
"""Of the optimum's frames, for each action."""
# Assumed: from free energy to prices at which always 2 DCS are the optimum.
SWEEP: Final = (0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8)


def check_solvable(laser: LaserConfig) -> None:
    """Refuse a laser for which the optimum cannot be computed.

    Raises
    ------
    ValueError
        Derating makes what is measured depend on the laser's temperature.
    """
    if laser.derate_per_k:
        raise ValueError(
            f"derate_per_k of laser {laser.name} is {laser.derate_per_k:g}; expected 0: the "
            "optimum does not know what a derated laser would measure"
        )


def measure_problem(
    validation: Possible, test: Possible, weights: RewardConfig, study: StudyConfig
) -> dict[str, Any]:
    """The acceptance numbers of the decision problem on test drives, with intervals.

    Parameters
    ----------
    validation, test : Possible
        Drives that tune the rule, and drives that are judged.
    weights : RewardConfig
        Weights of the reward.
    study : StudyConfig
        Bootstrap draws and confidence.

    Raises
    ------
    ValueError
        The laser is derated.

    Notes
    -----
    The best fixed and the best blind choice are picked on the test drives themselves, which
    favours them; the rule is tuned on the validation drives.
    """
    check_solvable(test.problem.config.laser)
    table = test.table(weights)
    best = clairvoyant(table)
    rivals = _rivals(validation.table(weights), table)
    found: dict[str, dict[str, Any]] = {
        name: {
            "choice": choice,
            **study_interval(excess, study, played.cost, best.cost).named("excess"),
            "goal": GOALS.get(name),
        }
        for name, (choice, played) in rivals.items()
    }
    working = np.maximum((best.actions >= 0).sum(axis=1), 1)  # frames with laser, of each drive
    shares = {
        str(shots): study_interval(
            mean, study, (best.actions == shots.action).sum(axis=1) / working
        ).named("mean")
        for shots in Shots
    }
    return {
        "drives": len(best.cost),
        "optimum": {
            "cost_per_drive": study_interval(mean, study, best.cost).named("mean"),
            "shots_share": shares,
            "tripped_share": best.tripped_share,
        },
        "excess": found,
        "holds": all(one["goal"] is None or one["excess"] >= one["goal"] for one in found.values())
        and all(share["mean"] >= LEAST_SHARE for share in shares.values()),
        "sweep": [_at_weight(test, weights, power) for power in SWEEP],
    }


def _rivals(validation: DriveTable, table: DriveTable) -> dict[str, tuple[str, PlayedTable]]:
    """Each kind of policy at its best: what it chooses, and how it plays."""
    blind = dict(blind_choices())
    fixed = {f"always {shots}": always(shots.action) for shots in Shots}
    best_fixed, best_blind = best_choice(table, fixed.items()), best_choice(table, blind.items())
    rule = best_rule(validation)
    # Of the two that do not look ahead the better one counts: which it is depends on the laser, as
    # avoiding a trip may cost more than the frames without laser do.
    short_sighted = {
        "least cost of the frame": greedy(table, guarded=False),
        "least cost of the frame that does not trip": greedy(table, guarded=True),
    }
    return {
        "best_fixed": (best_fixed, play(table, fixed[best_fixed])),
        "best_blind": (best_blind, play(table, blind[best_blind])),
        "threshold_rule": (str(rule), play(table, threshold(*rule))),
        "greedy": min(short_sighted.items(), key=lambda item: item[1].cost.sum()),
    }


def _at_weight(test: Possible, weights: RewardConfig, power: float) -> dict[str, Any]:
    """What another weight of power makes of the problem."""
    table = test.table(weights.model_copy(update={"power": power}))
    best = clairvoyant(table)
    costs = {shots: play(table, always(shots.action)).cost.sum() for shots in Shots}
    cheapest = min(Shots, key=costs.__getitem__)
    return {
        "power": power,
        "shots_share": best.shares.tolist(),
        "best_fixed": f"always {cheapest}",
        "best_fixed_excess": float(costs[cheapest] / best.cost.sum() - 1.0),
    }


def print_problem(found: dict[str, Any], config: DemoConfig) -> None:
    """The numbers that `measure_problem` found for `config`, as text."""
    optimum, env = found["optimum"], config.env
    measured = f"bank {env.bank}, unwrapper {env.unwrapper}, laser {env.laser.name}"
    weights = ", ".join(f"{name} {value:g}" for name, value in env.reward.model_dump().items())
    drives = f"{found['drives']} {config.study.split} drives"
    print(f"{measured}; reward: {weights}")
    print(f"Clairvoyant optimum over {drives} ({config.study.confidence:.0%} intervals)")
    for shots, share in optimum["shots_share"].items():
        print(
            f"  {shots} DCS in {share['mean']:6.1%} of frames  "
            f"({share['low']:.1%} to {share['high']:.1%}; goal at least {LEAST_SHARE:.0%})"
        )
    print(f"  laser off in {optimum['tripped_share']:.1%} of frames")
    print("\nWhat others cost more than the optimum")
    for name, one in found["excess"].items():
        print(
            f"  {name.replace('_', ' '):15}{one['excess']:6.1%}  "
            f"({one['low']:.1%} to {one['high']:.1%}; goal at least {one['goal']:.0%})  "
            f"{one['choice']}"
        )
    print(
        "\nWeight of power   shares of 2 / 4 / 8 in the optimum   best fixed choice and its excess"
    )
    for row in found["sweep"]:
        shares = " / ".join(f"{share:4.0%}" for share in row["shots_share"])
        print(
            f"  {row['power']:<16g}{shares:37}{row['best_fixed']}, {row['best_fixed_excess']:.1%}"
        )
    held = "holds" if found["holds"] else "DOES NOT hold"
    print(f"\nThis problem ({measured}) {held} every goal.")
