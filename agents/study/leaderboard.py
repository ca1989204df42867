"""What the jobs of a study played, as a table for each preset and each place of a transfer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from agents.config import StudyPlan
from agents.evaluation import (
    PACKAGES,
    Interval,
    PlayedFront,
    measures_of,
    price_of,
    references,
)
from agents.study.job_results import read_result
from agents.study.job_runs import bank_of
from agents.study.jobs import REFERENCES, Job
from agents.study.seed_statistics import Resamples
from unwrap.support import progress

MEASURES: Final[tuple[str, ...]] = ("gap_closed", "error_at_half_energy", "energy_at_equal_error")
"""See `agents.evaluation.compare_fronts`. There is no gap without an optimum."""
RETURN: Final = "return"
"""Of a drive at the preset's price of power."""
ROUNDING: Final = 1e-9
RANKED_BY: Final = "error_at_half_energy"


def make_leaderboard(plan: StudyPlan, jobs: Sequence[Job], folder: Path) -> dict[str, Any]:
    """The content of `results.json`, of jobs that have all been run.

    Raises
    ------
    ValueError
        A result is missing, damaged, or of other clips than the rest of its table.
    """
    tables, seconds = {}, 0.0
    for name in dict.fromkeys(job.table for job in jobs):
        tables[name], took = _table([job for job in jobs if job.table == name], folder)
        seconds += took
    elsewhere = plan.transfer.tables if plan.transfer else {}
    return {
        "plan": plan.model_dump(mode="json"),
        "seconds": seconds,
        "versions": {name: version(name) for name in PACKAGES},
        "presets": {name: table for name, table in tables.items() if name not in elsewhere},
        "transfer": {name: tables[name] for name in elsewhere},
    }


def _table(jobs: Sequence[Job], folder: Path) -> tuple[dict[str, Any], float]:
    """One table's rows, and the seconds that its jobs took."""
    results = {job.name: read_result(folder / job.name) for job in jobs}
    config, measured_by = next(
        (job.config, results[job.name]) for job in jobs if job.kind == REFERENCES
    )
    blind, optimum = measured_by.fronts["blind"], measured_by.fronts.get("optimum")
    cool_eight_m = measured_by.arrays["cool_eight_m"]
    rows: dict[str, list[PlayedFront]] = {}
    for job in jobs:
        if job.kind != REFERENCES:
            rows.setdefault(job.policy, []).append(results[job.name].fronts["front"])
            if not np.array_equal(rows[job.policy][-1].front.frames, blind.front.frames):
                raise ValueError(f"{folder / job.name}.npz is of other clips than {REFERENCES}")
    price, frames = price_of(config.env), blind.front.frames
    returns = {name: np.stack([_returns(one, price) for one in row]) for name, row in rows.items()}

    def measured(weight: np.ndarray) -> dict[str, dict[str, np.ndarray]]:
        """Each measure of each row's seeds, [S], where clips count `weight` [C] times."""
        against = references(blind, optimum, cool_eight_m, weight)
        found: dict[str, dict[str, np.ndarray]] = {}
        for name, row in rows.items():
            each = [measures_of(one, blind, against, weight) for one in row]
            found[name] = {
                measure: np.array([one[measure] for one in each])
                for measure in MEASURES
                if measure in each[0]
            }
            found[name][RETURN] = returns[name] @ weight / (weight @ frames)
        return found

    resamples = Resamples.draw(len(frames), config.study)
    point, drawn = measured(np.ones(len(frames))), []
    with progress(len(resamples.clips), f"resamples of {jobs[0].table}", "draw") as bar:
        for weight in resamples.clips:
            drawn.append(measured(weight))
            bar.update(1)
    told = {
        name: {
            measure: _over_seeds(
                resamples, values, np.stack([one[name][measure] for one in drawn]), number
            )
            for measure, values in point[name].items()
        }
        for number, name in enumerate(rows)
    }
    best = min(told, key=lambda name: told[name][RANKED_BY]["iqm"])
    table = {
        "bank": bank_of(config.env),
        "env": config.env.model_dump(mode="json"),
        "price": price,
        "split": config.study.split,
        "clips": len(frames),
        "drives": config.study.drives,
        "best": best,
        "rows": told,
        "improvement": _improvements(resamples, returns, frames),
        "fronts": {name: [one.rows for one in row] for name, row in rows.items()}
        | {"blind": [blind.rows]}
        | ({"optimum": [optimum.rows]} if optimum else {}),
    }
    return table, sum(one.seconds for one in results.values())


def _returns(front: PlayedFront, price: float) -> np.ndarray:
    """Sum over the frames of each clip of the return at `price`, float64 [C]."""
    return front.returns[:, front.prices.index(price)]


def _over_seeds(
    resamples: Resamples, point: np.ndarray, drawn: np.ndarray, number: int
) -> dict[str, Any]:
    return {
        **resamples.over_seeds(point, drawn, number).named("iqm"),
        "mean": float(point.mean()),
        "median": float(np.median(point)),
        "seeds": point.tolist(),
    }


def _improvements(
    resamples: Resamples, returns: Mapping[str, np.ndarray], frames: np.ndarray
) -> dict[str, dict[str, Any]]:
    """Of each row over each other one, by the return of a clip's frames."""
    names = list(returns)
    found: dict[str, dict[str, Any]] = {name: {} for name in names}
    for i, one in enumerate(names):
        for j, other in enumerate(names):
            if i != j:
                interval = resamples.improvement(
                    returns[one] / frames, returns[other] / frames, (i, j)
                )
                found[one][other] = {
                    **interval.named("probability"),
                    "significant": is_significant(interval),
                }
    return found


def is_significant(probability: Interval) -> bool:
    """Whether the interval of a probability of improvement leaves out even chances."""
    # Sums of halves are rounded.
    return not probability.low - ROUNDING <= 0.5 <= probability.high + ROUNDING
