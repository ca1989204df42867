"""The tables of `docs/policies.md`: policies of practice, tuned, on drives that tuned none of them.

python docs/policies_table.py

Each family is tuned on validation drives at each price of power, by `agents.tune`, and then plays
test drives, as do the two clairvoyants of `agents.optimum`. Intervals are over clips. What was
measured goes to a JSON file (`--json`), the tables into the page. Another file than the page's own
gets its tables beside it, as Markdown: `--env hot --json hot.json` writes `hot.md`.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from marked_tables import marked, said

from agents import FAMILIES_OF_PRACTICE, tune, tuning_envs
from agents.config import StudyConfig
from agents.evaluation import drive_seeds, make_envs, play_drives, ratio, study_interval
from agents.optimum import PlayedTable, Possible, by_clip, clairvoyant, greedy, tabulate
from shotenv.config import EnvConfig, env_config
from shotenv.decision import open_problem
from unwrap.signal import Shots
from unwrap.support import write_json, write_text

PAGE: Final = Path(__file__).with_name("policies.md")
KEPT: Final = PAGE.with_suffix(".json")
PRICES: Final = (0.02, 0.06, 0.09, 0.2)
"""Prices of power; .09 is the default's."""
Row = dict[str, Any]


def measured(config: EnvConfig, study: StudyConfig, prices: Sequence[float]) -> dict[str, Any]:
    """Every family at each of the prices, and the processor time it took."""
    # Of the process, for a machine that does other work, too, says nothing by its clock.
    start = time.process_time()
    seeds = drive_seeds(study, study.tuning_drives)
    envs = tuning_envs(config, study.tuning_drives)
    tuned = tune(FAMILIES_OF_PRACTICE, envs, seeds, prices)
    tuning_s = time.process_time() - start
    rows = [*rows_of_practice(tuned, config, study)]
    # A derated laser's power follows its temperature: the clairvoyants do not know what follows.
    if not config.laser.derate_per_k:
        rows += clairvoyants(config, study, prices)
    return {
        "env": config.model_dump(mode="json"),
        "study": study.model_dump(mode="json"),
        "prices": list(prices),
        "tuning_s": tuning_s,
        "seconds": time.process_time() - start,
        "rows": rows,
    }


def rows_of_practice(
    tuned: Mapping[str, Sequence[Any]], config: EnvConfig, study: StudyConfig
) -> Iterator[Row]:
    """A row for each family and price: what the tuned policy does on the drives of the study."""
    envs, seeds = (
        make_envs(config, study.split, study.drives, "Disabled"),
        drive_seeds(study, study.drives),
    )
    for family, of_price in tuned.items():
        for one in of_price:
            played = play_drives(one.policy, envs, seeds, price=one.price)
            sums = played.per_clip()
            shots, frames = by_clip(played.shots.astype(float), played.clip), sums["return"][1]
            sums["laser_energy_share"] = shots / Shots.EIGHT, frames
            yield row(family, one.price, str(one.policy), sums, study)


def clairvoyants(config: EnvConfig, study: StudyConfig, prices: Sequence[float]) -> Iterator[Row]:
    """Rows of those who know what every choice would bring, in this frame and in all."""
    problem = open_problem(config.model_copy(update={"split": study.split}))
    possible = tabulate(problem, drive_seeds(study, study.drives))
    for price in prices:
        table = possible.table(price=price)
        for name, words, best in (
            ("clairvoyant greedy", "the least cost of each frame", greedy(table, guarded=True)),
            ("clairvoyant optimum", "dynamic programming", clairvoyant(table)),
        ):
            yield row(name, price, words, sums_of(best, possible, price), study)


def sums_of(
    best: PlayedTable, possible: Possible, price: float
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """As `PlayedDrives.per_clip`, of what a clairvoyant chose."""
    table, clips, lit = possible.table(price=price), possible.clips(), best.actions >= 0
    taken = np.maximum(best.actions, 0)[..., None]
    depth_mae_m = np.take_along_axis(table.depth_mae_m, taken, axis=-1)[..., 0]
    gained = table.scale * (table.reference - best.frame_cost) * best.actions.shape[1]
    energy = np.array([*Shots, 0])[best.actions] / Shots.EIGHT
    frames = by_clip(np.ones(clips.shape), clips)
    return {
        "return": (by_clip(gained, clips), frames),
        "laser_energy_share": (by_clip(energy, clips), frames),
        "depth_mae_m": (by_clip(depth_mae_m * lit, clips), by_clip(lit.astype(float), clips)),
    }


def row(
    family: str,
    price: float,
    words: str,
    sums: Mapping[str, tuple[np.ndarray, np.ndarray]],
    study: StudyConfig,
) -> Row:
    """Means over drives with their intervals over clips."""
    measures = ("return", "laser_energy_share", "depth_mae_m")
    means = {name: study_interval(ratio, study, *sums[name]).named("mean") for name in measures}
    return {"family": family, "price": price, "policy": words, **means}


def tables(found: Mapping[str, Any]) -> str:
    """The tables, one for each price, the best return first, and what they were measured on."""
    study = found["study"]
    lines = [
        f"Tuned on {study['tuning_drives']} validation drives, played on {study['drives']} drives "
        f"of split `{study['split']}`, bank `{found['env']['bank']}`; {study['confidence']:.0%} "
        f"intervals over clips. It took {found['seconds'] / 60:.1f} minutes of one core, "
        f"{found['tuning_s'] / 60:.1f} of them for tuning.",
    ]
    for price in found["prices"]:
        of_price = [one for one in found["rows"] if one["price"] == price]
        of_price.sort(key=lambda one: -one["return"]["mean"])
        lines += [
            f"\n### Price of power {price:g}\n",
            "| family | return | laser energy | depth error | the tuned policy |",
            "|---|---|---|---|---|",
        ]
        for one in of_price:
            cells = (
                f"`{one['family']}`",
                said(one["return"], 1, 0, ""),
                said(one["laser_energy_share"], 100, 0, " %"),
                said(one["depth_mae_m"], 1, 2, " m"),
                one["policy"],
            )
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def filled(page: str, found: Mapping[str, Any]) -> str:
    """`page` with the tables between their marks."""
    return marked(page, "tables", tables(found), PAGE)


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write what was measured."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--env", default="default", help="preset, or path of a configuration")
    parser.add_argument("--bank", help="another bank than the environment's")
    parser.add_argument("--drives", type=int, default=24, help="test drives")
    parser.add_argument("--tuning-drives", type=int, default=12, help="validation drives")
    parser.add_argument("--prices", type=float, nargs="+", default=PRICES)
    parser.add_argument("--json", type=Path, default=KEPT)
    chosen = parser.parse_args(arguments)
    torch.set_num_threads(1)  # maps are small, and threads would wait for each other
    config = env_config(chosen.env, **({"bank": chosen.bank} if chosen.bank else {}))
    study = StudyConfig(drives=chosen.drives, tuning_drives=chosen.tuning_drives)
    write_json(chosen.json, measured(config, study, chosen.prices))
    # From the file, as a test reads it: numbers of JSON are those of the page.
    found = json.loads(chosen.json.read_text(encoding="utf-8"))
    if chosen.json.resolve() == KEPT.resolve():
        write_text(PAGE, filled(PAGE.read_text(encoding="utf-8"), found))
    else:
        write_text(chosen.json.with_suffix(".md"), tables(found) + "\n")


if __name__ == "__main__":
    main()
