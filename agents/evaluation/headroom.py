"""How much there is to win in the decision problem, and whether fewer shots pay in it.

Cost is the weighted sum of the reward's terms; excess is how much more than the optimum a policy
costs over all drives. Intervals are over clips: drives pass the same ones again and again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from agents.config import StudyConfig
from agents.evaluation.foresight import foresee
from agents.evaluation.statistics import excess, ratio, resampled, study_interval
from agents.optimum import (
    DriveTable,
    Front,
    PlayedTable,
    Possible,
    always,
    best_choice,
    best_rule,
    blind_choices,
    blind_front,
    by_clip,
    clairvoyant,
    front_of,
    greedy,
    play,
    threshold,
)
from shotenv.config import LaserConfig
from unwrap.signal import Shots

HALF: Final = 0.5
"""Of the laser energy of always-8: where errors are compared."""
# Assumed, from free energy to prices at which always 2 DCS are the optimum.
SWEEP: Final = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)


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
    training: Possible,
    validation: Possible,
    test: Possible,
    study: StudyConfig,
    *,
    price: float | None = None,
) -> dict[str, Any]:
    """What the decision problem is like on test drives, with intervals.

    Parameters
    ----------
    training, validation, test : Possible
        Drives that teach what can be foreseen, that tune the rule, and that are judged.
    study : StudyConfig
        Bootstrap draws and confidence.
    price : float, optional
        Weight of power in all drives; each drive's own by default.

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
    table, clips = test.table(price=price), test.clips()
    best = clairvoyant(table)

    def per_clip(values: np.ndarray) -> np.ndarray:
        return by_clip(values, clips)

    found = {
        name: {
            "choice": choice,
            **study_interval(
                excess, study, per_clip(played.frame_cost), per_clip(best.frame_cost)
            ).named("excess"),
        }
        for name, (choice, played) in _rivals(validation.table(price=price), table).items()
    }
    working = per_clip((best.actions >= 0).astype(float))
    taken = np.maximum(best.actions, 0)[..., None]
    depth_mae_m = np.take_along_axis(table.depth_mae_m, taken, axis=-1)[..., 0]
    error = np.take_along_axis(table.error, taken, axis=-1)[..., 0]
    fronts = _fronts(training, test, table, clips)
    return {
        "drives": len(best.cost),
        "clips": len(working),
        "optimum": {
            "cost_per_drive": float(best.cost.mean()),
            "return_per_drive": float(table.returns(best.frame_cost).mean()),
            "shots_share": {
                str(shots): study_interval(
                    ratio, study, per_clip((best.actions == shots.action).astype(float)), working
                ).named("mean")
                for shots in Shots
            },
            "laser_energy_share": float(best.energy_share),
            "depth_mae_m": study_interval(ratio, study, per_clip(depth_mae_m), working).named(
                "mean"
            ),
            "tripped_share": best.tripped_share,
        },
        "fixed": _fixed(table),
        "excess": found,
        "cost_share_of_energy": float(1.0 - error.sum() / best.cost.sum()),
        **_at_half_energy(fronts, study),
        "fronts": {name: _listed(front) for name, front in fronts.items()},
        "held_back_drives_share": _held_back(table),
        "frame_explains": frame_explains(test),
        "families": _by_family(test, best),
        "sweep": [_at_price(test, other) for other in SWEEP],
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


def _fronts(
    training: Possible, test: Possible, table: DriveTable, clips: np.ndarray
) -> dict[str, Front]:
    """What knowing all, nothing, and what the sensor tells with and without looking reach."""
    with_looking, without = (foresee(training, looking=looking) for looking in (True, False))
    return {
        "clairvoyant": front_of(table.error, table, clips),
        "regression": front_of(with_looking.errors(test), table, clips),
        "regression_without_looking": front_of(without.errors(test), table, clips),
        "best_blind": blind_front(table, clips),
    }


def _at_half_energy(fronts: dict[str, Front], study: StudyConfig) -> dict[str, Any]:
    """Errors at half of always-8's energy; the energy at which each errs as blind choices there."""
    clusters = len(fronts["best_blind"].frames)

    def interval(of: Callable[[np.ndarray], float]) -> dict[str, float]:
        return resampled(of, clusters, study).named("mean")

    def error_of(front: Front) -> Callable[[np.ndarray], float]:
        return lambda weight: float(front.error_at(HALF, weight))

    def energy_of(front: Front) -> Callable[[np.ndarray], float]:
        blind = fronts["best_blind"]
        return lambda weight: front.energy_at(float(blind.error_at(HALF, weight)), weight)

    def less_than(one: str, other: str) -> dict[str, float]:
        a, b = fronts[one], fronts[other]
        return interval(
            lambda weight: float(1 - a.error_at(HALF, weight) / b.error_at(HALF, weight))
        )

    return {
        "error_at_half_energy": {name: interval(error_of(front)) for name, front in fronts.items()},
        "energy_at_equal_error": {
            name: interval(energy_of(front)) for name, front in fronts.items()
        },
        "clairvoyant_below_blind": less_than("clairvoyant", "best_blind"),
        "worth_of_looking": less_than("regression", "regression_without_looking"),
    }


def _listed(front: Front) -> list[dict[str, float]]:
    """Its points, but for those that a mixture of others is as good as."""
    once = np.ones(len(front.frames))
    energy, error_m = front.means(once)
    return [
        {"laser_energy_share": float(energy[i]), "depth_mae_m": float(error_m[i])}
        for i in front.corners(once)
    ]


def _fixed(table: DriveTable) -> dict[str, dict[str, float]]:
    """What each fixed choice brings with a laser that never trips."""
    return {
        str(shots): {
            "depth_mae_m": float(table.depth_mae_m[..., shots.action].mean()),
            "error": float(table.error[..., shots.action].mean()),
        }
        for shots in Shots
    }


def _held_back(table: DriveTable) -> float:
    """Share of drives in which heat keeps a scheduler that always asks for 8 DCS from them."""
    played = play(table, always(Shots.EIGHT.action))
    return float((played.actions < Shots.EIGHT.action).any(axis=1).mean())


def frame_explains(possible: Possible) -> dict[str, float]:
    """Share of the variance of what 8 DCS gain that the bank frame explains, over drives.

    What is left is laser power, integration time, imager and noise: with 1 the best choice could be
    looked up by frame. From the variance within frames that several drives pass, without bias.
    """
    frames = np.concatenate([drive.frames[0, :-1].numpy() for drive in possible.drives])
    error = np.concatenate([one.terms["error"].numpy() for one in possible.outcomes])
    _, number, count = np.unique(frames, return_inverse=True, return_counts=True)
    explained = {}
    for shots in (Shots.TWO, Shots.FOUR):
        gain = error[:, shots.action] - error[:, Shots.EIGHT.action]
        means = np.bincount(number, gain) / count
        left = np.square(gain - means[number])[count[number] > 1].sum()
        freedom = (count[count > 1] - 1).sum()
        within = left / freedom if freedom else 0.0
        explained[str(shots)] = float(1.0 - within / max(gain.var(), 1e-12))
    return explained


def _by_family(possible: Possible, best: PlayedTable) -> dict[str, list[float]]:
    """Shares of 2, 4 and 8 DCS in the optimum, by the family of the scene."""
    bank = possible.problem.bank
    families = np.array([bank.clips[clip].family for clip in possible.clips().ravel()])
    actions = best.actions.ravel()
    return {
        str(family): [float(np.mean(actions[families == family] == n.action)) for n in Shots]
        for family in np.unique(families)
    }


def _at_price(test: Possible, price: float) -> dict[str, Any]:
    """What another price of power makes of the problem."""
    table = test.table(price=price)
    best = clairvoyant(table)
    costs = {shots: play(table, always(shots.action)).cost.sum() for shots in Shots}
    cheapest = min(Shots, key=costs.__getitem__)
    return {
        "power": price,
        "shots_share": best.shares.tolist(),
        "best_fixed": f"always {cheapest}",
        "best_fixed_excess": float(costs[cheapest] / best.cost.sum() - 1.0),
    }
