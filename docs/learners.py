"""Trained schedulers beside fixed choices and tuned rules that look, at several prices of power.

for learner in ppo recurrent_ppo dqn qrdqn regression; do
    .venv/bin/shotenv train --agent configs/agent/$learner.yaml --out runs/$learner
done
.venv/bin/python docs/learners.py runs/ppo runs/recurrent_ppo runs/dqn runs/qrdqn runs/regression

prints a table of mean returns on 48 test drives. Rules are tuned on 12 validation drives at each
price; a scheduler is the same at all.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Final

import numpy as np
import torch

from agents.evaluation import FIXED_POLICIES, PlayedDrives, make_envs, play_drives, tune
from agents.policies import FAMILIES_OF_PRACTICE, Policy, load_policy
from shotenv.config import env_config

PRICES: Final = (0.02, 0.04, 0.09, 0.2)
RULES: Final = ("look_and_hold", "look_and_weigh", "look_and_weigh_heat")
TEST: Final = range(1000, 1048)
TUNING: Final = range(1000, 1012)


def row(name: str, played: list[PlayedDrives]) -> str:
    """Return, error and energy at each price, as a row of a table."""
    cells = [
        f"{drives.returns_at(price).mean():.0f} ({np.nanmean(drives.depth_mae_m):.2f} m, "
        f"{drives.shots.mean() / 8:.0%})"
        for price, drives in zip(PRICES, played, strict=True)
    ]
    return f"| {' | '.join([name, *cells])} |"


def main() -> None:
    """Play, and print row by row."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("schedulers", type=Path, nargs="*", help="folders of `shotenv train`")
    parser.add_argument("--bank", default="pocket", help="name or path of a bank")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    config = env_config(bank=arguments.bank)
    test = make_envs(config, "test", len(TEST), "Disabled")

    def show(name: str, policies: list[Policy]) -> None:
        pairs = zip(policies, PRICES, strict=True)
        played = [play_drives(policy, test, TEST, price=price) for policy, price in pairs]
        print(row(name, played), flush=True)

    for name, fixed in FIXED_POLICIES.items():
        show(name, [fixed] * len(PRICES))
    validation = make_envs(config, "validation", len(TUNING), "Disabled")
    families = [family for family in FAMILIES_OF_PRACTICE if family.name in RULES]
    for name, best in tune(families, validation, TUNING, PRICES).items():
        show(f"{name}, tuned", [one.policy for one in best])
    for folder in arguments.schedulers:
        show(folder.name, [load_policy(folder)] * len(PRICES))


if __name__ == "__main__":
    main()
