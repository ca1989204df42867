"""Whether a thinned bank poses the same problem as every pixel of the bank that it was made from.

.venv/bin/python docs/pocket_agreement.py wide pocket --drives 24 --json agreement.json

Ten choices of different kinds (fixed, cycles, mixtures, one-threshold rules) and the clairvoyant
optimum are played on both, on the same drives: same clips, laser, integration time and temperature;
noise and offsets are drawn anew, for there are other pixels. It prints the mean return of a frame
with its 95 % interval over drives, and fails where

- a mean lies outside the other bank's interval,
- two choices whose difference is clear on every pixel (interval of the paired difference without 0)
  come in another order, or
- choices that are optimal on the thinned bank cost over 2 % more than the optimum on every pixel.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping
from itertools import combinations
from pathlib import Path

import numpy as np
import torch

from agents.optimum import DriveTable, always, clairvoyant, play, tabulate, threshold
from agents.optimum.choices import cycle, mixture
from shotenv.config import env_config
from shotenv.decision import open_problem
from unwrap.support import progress

CHOICES = {
    "always 2": always(0),
    "always 4": always(1),
    "always 8": always(2),
    "8 every 4 frames, else 2": cycle((2, 0, 0, 0)),
    "8 every 8 frames, else 4": cycle((2, *(1,) * 7)),
    "mixture 50/30/20 % of 2/4/8": mixture((0.5, 0.3, 0.2)),
    "mixture 20/20/60 % of 2/4/8": mixture((0.2, 0.2, 0.6)),
    "8 below a signal to noise of .5, else 2": threshold(0.5, 2, 0),
    "2 below a signal to noise of .5, else 8": threshold(0.5, 0, 2),
    "4 below a signal to noise of .6, else 8": threshold(0.6, 1, 2),
}
MOST_EXCESS = 0.02
DRAWS = 10_000
Statistic = Callable[[np.ndarray], np.ndarray]


def table_of(bank: str, drives: int, config: str, split: str) -> DriveTable:
    """What each action brings in `drives` drives of a bank."""
    problem = open_problem(env_config(config, bank=bank, split=split))
    frames = drives * problem.config.frames_per_drive
    with progress(frames, f"drives of {bank}", "frame") as bar:
        possible = tabulate(problem, range(drives), tick=bar.update)
    return possible.table()


def interval(values: np.ndarray) -> tuple[float, float]:
    """Bootstrap interval, 95 %, of the mean of a value of each drive."""
    drawn = np.random.default_rng(0).integers(0, len(values), (DRAWS, len(values)))
    low, high = np.quantile(values[drawn].mean(axis=1), (0.025, 0.975))
    return float(low), float(high)


def returns(table: DriveTable) -> dict[str, np.ndarray]:
    """Mean return of a frame of each drive, [N], by choice; and of the optimum."""
    frames = table.cost.shape[1]
    found = {name: -play(table, choose).cost / frames for name, choose in CHOICES.items()}
    return {**found, "clairvoyant": -clairvoyant(table).cost / frames}


def compare(full: DriveTable, thinned: DriveTable) -> dict[str, object]:
    """How far apart the two tables are, as numbers."""
    on_full, on_thinned = returns(full), returns(thinned)
    rows = {}
    for name in on_full:
        (low, high), (thin_low, thin_high) = interval(on_full[name]), interval(on_thinned[name])
        mean, thin_mean = float(on_full[name].mean()), float(on_thinned[name].mean())
        agrees = low <= thin_mean <= high and thin_low <= mean <= thin_high
        rows[name] = {
            "full": {"mean": mean, "low": low, "high": high},
            "thinned": {"mean": thin_mean, "low": thin_low, "high": thin_high},
            "agrees": agrees,
        }
    swapped = [pair for pair in combinations(on_full, 2) if swaps(on_full, on_thinned, *pair)]
    # Where the optimum had no laser, its choice is -1: none was made.
    actions = clairvoyant(thinned).actions.clip(min=0)
    moved = float(play(full, lambda now: actions[:, now.frame]).cost.sum())
    excess = moved / float(clairvoyant(full).cost.sum()) - 1.0
    holds = all(row["agrees"] for row in rows.values()) and not swapped and excess <= MOST_EXCESS
    return {"choices": rows, "swapped": swapped, "excess": excess, "holds": holds}


def swaps(
    on_full: Mapping[str, np.ndarray], on_thinned: Mapping[str, np.ndarray], one: str, other: str
) -> bool:
    """Whether two choices that clearly differ on every pixel rank otherwise on the thinned bank."""
    low, high = interval(on_full[one] - on_full[other])
    clear = low > 0 or high < 0
    thinned = float((on_thinned[one] - on_thinned[other]).mean())
    return clear and thinned * (low + high) < 0


def print_comparison(found: dict) -> None:
    """The numbers of `compare` as a table."""
    print(f"{'mean return of a frame':42}{'every pixel':>26}{'thinned':>26}")
    for name, row in found["choices"].items():
        cells = [
            f"{cell['mean']:9.4f} ({cell['low']:.4f}, {cell['high']:.4f})"
            for cell in (row["full"], row["thinned"])
        ]
        print(f"{name:42}" + "".join(f"{cell:>26}" for cell in cells), "" if row["agrees"] else "!")
    print(f"clear differences in another order: {found['swapped'] or 'none'}")
    print(f"choices optimal on the thinned bank cost {found['excess']:.2%} more on every pixel")


def main() -> int:
    """Compare, print, and tell by the exit status whether the problems agree."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("full", help="name or path of the rendered bank")
    parser.add_argument("thinned", help="name or path of the bank made from it")
    parser.add_argument("--drives", type=int, default=24)
    parser.add_argument("--config", default="default", help="configuration of the environment")
    parser.add_argument("--split", default="test")
    parser.add_argument("--json", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    found = compare(
        *(
            table_of(bank, arguments.drives, arguments.config, arguments.split)
            for bank in (arguments.full, arguments.thinned)
        )
    )
    print_comparison(found)
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    return 0 if found["holds"] else 1


if __name__ == "__main__":
    sys.exit(main())
