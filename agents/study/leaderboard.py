"""What the jobs of a study played, as a table for each preset and each place of a transfer."""

from __future__ import annotations

from collections.abc import Sequence, Set
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import numpy as np

from agents.config import DemoConfig, StudyPlan
from agents.evaluation import PACKAGES, PlayedFront, price_of
from agents.study.clip_groups import clip_groups
from agents.study.job_results import read_result
from agents.study.job_runs import bank_of
from agents.study.jobs import REFERENCES, Job
from agents.study.seed_statistics import Resamples
from agents.study.table_fronts import TableFronts, leaves_out

RANKED_BY: Final = "error_at_half_energy"
GROUP_DRAWS: Final = 250
"""Resamples of a group of clips at most (assumed): there are eight groups in a table."""


def make_leaderboard(plan: StudyPlan, jobs: Sequence[Job], folder: Path) -> dict[str, Any]:
    """The content of `results.json`, of jobs that have all been run.

    Raises
    ------
    ValueError
        A result is missing, damaged, or of other clips than the rest of its table.
    """
    tables, seconds = {}, 0.0
    for name in dict.fromkeys(job.table for job in jobs):
        of_table = [job for job in jobs if job.table == name]
        tables[name], took = _table(of_table, folder, set(plan.ablations))
        seconds += took
    elsewhere = plan.transfer.tables if plan.transfer else {}
    return {
        "plan": plan.model_dump(mode="json"),
        "seconds": seconds,
        "versions": {name: version(name) for name in PACKAGES},
        "presets": {name: table for name, table in tables.items() if name not in elsewhere},
        "transfer": {name: tables[name] for name in elsewhere},
    }


def _table(jobs: Sequence[Job], folder: Path, ablations: Set[str]) -> tuple[dict[str, Any], float]:
    """One table's rows, and the seconds that its jobs took."""
    results = {job.name: read_result(folder / job.name) for job in jobs}
    config, measured_by = next(
        (job.config, results[job.name]) for job in jobs if job.kind == REFERENCES
    )
    blind, optimum = measured_by.fronts["blind"], measured_by.fronts.get("optimum")
    rows: dict[str, list[PlayedFront]] = {}
    kinds: dict[str, str] = {}
    for job in jobs:
        if job.kind != REFERENCES:
            rows.setdefault(job.policy, []).append(results[job.name].fronts["front"])
            kinds[job.policy] = job.kind
            if not np.array_equal(rows[job.policy][-1].front.frames, blind.front.frames):
                raise ValueError(f"{folder / job.name}.npz is of other clips than {REFERENCES}")
    fronts = TableFronts(
        rows, blind, optimum, measured_by.arrays["cool_eight_m"], price_of(config.env)
    )
    name = jobs[0].table
    resampled = fronts.resampled(config.study, name)
    told = resampled.rows()
    # What is not shown all is there to be compared, and not to be used.
    ranked = [row for row in told if row not in ablations] or list(told)
    best = min(ranked, key=lambda row: told[row][RANKED_BY]["iqm"])
    table = {
        "bank": bank_of(config.env),
        "env": config.env.model_dump(mode="json"),
        "price": fronts.price,
        "split": config.study.split,
        "clips": len(fronts.frames),
        "drives": config.study.drives,
        "kinds": kinds,
        "ablations": sorted(ablations & set(kinds)),
        "best": best,
        "rows": told,
        "differences": resampled.differences(best),
        "improvement": _improvements(resampled.resamples, fronts),
        "groups": {
            by: {group: _group(fronts, chosen, config, group) for group, chosen in groups.items()}
            for by, groups in clip_groups(config).items()
        },
        "fronts": {row: [one.rows for one in of_row] for row, of_row in rows.items()}
        | {"blind": [blind.rows]}
        | ({"optimum": [optimum.rows]} if optimum else {}),
    }
    return table, sum(one.seconds for one in results.values())


def _group(
    fronts: TableFronts, chosen: np.ndarray, config: DemoConfig, name: str
) -> dict[str, Any]:
    """The rows, measured on a group of the clips."""
    draws = min(config.study.bootstrap_draws, GROUP_DRAWS)
    study = config.study.model_copy(update={"bootstrap_draws": draws})
    rows = fronts.of_clips(chosen).resampled(study, name).rows()
    return {"clips": int(chosen.sum()), "rows": rows}


def _improvements(resamples: Resamples, fronts: TableFronts) -> dict[str, dict[str, Any]]:
    """Of each row over each other one, by the return of a clip's frames."""
    returns = {name: sums[0] / fronts.frames for name, sums in fronts.at_price.items()}
    found: dict[str, dict[str, Any]] = {name: {} for name in returns}
    for i, one in enumerate(returns):
        for j, other in enumerate(returns):
            if i != j:
                interval = resamples.improvement(returns[one], returns[other], (i, j))
                found[one][other] = {
                    **interval.named("probability"),
                    "significant": leaves_out(interval, 0.5),
                }
    return found
