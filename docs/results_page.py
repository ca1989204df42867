"""`docs/results.md` and its picture, from what a study measured.

shotenv study configs/study/results.yaml --out runs/study
python docs/results_page.py runs/study

The first takes hours and continues where it was interrupted. The picture needs matplotlib.
`--page FILE` writes the page of another study elsewhere, with its picture beside it.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any, Final

from results.picture import paint
from results.rows import ablations, answer, leaderboard
from results.tables import by_groups, elsewhere

DOCS = Path(__file__).parent
PAGE = DOCS / "results.md"
LEAST_SEEDS: Final = 5
"""Of a study whose numbers count."""


def page(found: dict[str, Any], picture: str, command: str) -> str:
    """The whole page."""
    plan, tables = found["plan"], found["presets"]
    versions = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    parts = ["# Results", *(answer(preset, table) for preset, table in tables.items())]
    if len(plan["seeds"]) < LEAST_SEEDS:
        parts.append(
            f"**These numbers only show that the study works:** {len(plan['seeds'])} training "
            f"seeds and {plan['study']['drives']} drives; a study that counts has "
            f"{LEAST_SEEDS} seeds or more."
        )
    parts += [
        f"![Depth error against laser energy by preset: every point was played]({picture})",
        *(leaderboard(preset, table) for preset, table in tables.items()),
        *([ablations(plan)] if plan["ablations"] else []),
        *(by_groups(preset, table) for preset, table in tables.items()),
        *([elsewhere(plan, found["transfer"])] if found["transfer"] else []),
        "## How to read the tables",
        LEGEND.format(confidence=f"{plan['study']['confidence']:.0%}".replace("%", " %")),
        f"Made by `{command}` with training seeds {', '.join(map(str, plan['seeds']))}, in "
        f"{found['seconds'] / 3600:.1f} hours of one core, without trainings "
        f"that stood already. {versions}.",
        SUBMIT,
    ]
    return "\n\n".join(parts) + "\n"


LEGEND: Final = """Every policy plays the same drives with the same noise, once at each price of
power. *Gap closed*: 0 is the best mixture that looks at nothing, 1 the optimum that knows all, at
the same energy, averaged over .3 to .9 of the energy of 8 DCS in every frame. *Energy saved* is
that of 8 DCS asked for in every frame of the same drives, at its error and at 10 % more. Any front
may be mixed with choices that look at nothing. A row is the interquartile mean over its training
seeds (of 5 the middle 3); brackets are {confidence} intervals that resample seeds and, in common
for all, clips; *of its seeds* are the best and the worst. *Does better*: probability that the best
row that is no ablation has a higher return on a clip, over clips and pairs of seeds ([Agarwal et
al. 2021](https://arxiv.org/abs/2108.13264)). It is the best by the drives that are shown, which
favours it. `ridge` is a linear regression on the frames that the regression learns from, and
`random` draws from all three actions: what a learned policy must beat. Rules are tuned on
validation drives at each price."""


SUBMIT: Final = """## Your policy on this board

Add a line to `policies` of `configs/study/results.yaml`: the path of an agent's YAML file, which is
trained with each seed; or the folder of a scheduler that `shotenv train` saved; or a family of your
own, a few lines in `agents/policies/practice.py`. `shotenv study` then plays it alone, since what
stands is not played again. To have it re-scored, open a pull request with the line and the file:
whoever merges it runs the same command, and row and digest must come out the same. Train and tune
on train and validation clips; test clips are for playing."""


def main() -> None:
    """Write the page and its picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, help="what `shotenv study --out` wrote")
    parser.add_argument("--page", type=Path, default=PAGE, help="the page's file")
    parser.add_argument(
        "--study", default="configs/study/results.yaml", help="its file, as the page names it"
    )
    arguments = parser.parse_args()
    path = arguments.folder / "results.json"
    if not path.is_file():
        parser.error(f"{path} is missing; `shotenv study {arguments.study}` writes it")
    found = json.loads(path.read_text(encoding="utf-8"))
    picture = arguments.page.parent / "images" / "results.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    command = (
        f"shotenv study {arguments.study} --out {arguments.folder} && "
        f"python docs/results_page.py {arguments.folder}"
    )
    paint(found["presets"], picture)
    text = page(found, f"images/{picture.name}", command)
    arguments.page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
