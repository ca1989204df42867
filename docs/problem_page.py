"""`docs/problem.md`, its picture and the README's table, from what was measured.

Into one folder DIR, for each of the presets default hot battery night_shift paper strong:

shotenv problem --env configs/env/PRESET.yaml --json DIR/PRESET.json (--goals hot for hot)
python docs/learnability.py --json DIR/learnability.json

Then `python docs/problem_page.py DIR` keeps what the page needs in `docs/problem/`; without DIR it
writes the page from there. The picture needs matplotlib.
"""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

from marked_tables import marked

from shotenv.config import configs_dir

DOCS = Path(__file__).parent
PAGE = DOCS / "problem.md"
PICTURE = DOCS / "images" / "problem.png"
README = DOCS.parent / "README.md"
NUMBERS = DOCS / "problem"
PRESETS = ("default", "hot", "battery", "night_shift", "paper", "strong")
LEARNERS = "learnability"
UNUSED = ("frame_explains", "sweep")
"""What `shotenv problem` tells beside what is on the page."""
ROWS = {
    "best_blind": "best choice that looks at nothing",
    "regression_without_looking": "foresight from gray image and network",
    "regression": ("the same, told what the last frame's shorter acquisitions were found to lose"),
    "clairvoyant": "clairvoyant",
}
"""Of the README's table."""
FRONTS = {
    "clairvoyant": ("clairvoyant: knows every outcome", "#0b3d91", "-"),
    "regression": ("foresight, told what looking showed", "#c2410c", "-"),
    "regression_without_looking": ("foresight without looking", "#c2410c", "--"),
    "best_blind": ("blind: drawn with fixed shares", "#64748b", "-"),
}


def percent(value: float) -> str:
    """As whole percent."""
    return f"{100 * value:.0f} %"


def interval(one: dict[str, float], name: str, form: str) -> str:
    """Point estimate and interval."""
    scale = 100 if form == "%" else 1
    digits = 0 if form == "%" else 2
    value, low, high = (scale * one[key] for key in (name, "low", "high"))
    return f"{value:.{digits}f} {form} ({low:.{digits}f} to {high:.{digits}f})"


def purpose(preset: str) -> str:
    """What the first comment of a preset says."""
    lines = (configs_dir() / "env" / f"{preset}.yaml").read_text(encoding="utf-8").splitlines()
    comment = []
    for line in lines:
        if not line.startswith("# "):
            break
        comment.append(line[2:])
    return " ".join(comment)


def goals(found: dict[str, Any]) -> str:
    """The table of goals."""
    rows = ["| what | measured | goal |", "|---|---|---|"]
    for name, goal in found["goals"].items():
        most = f" and at most {percent(goal['most'])}" if "most" in goal else ""
        word = "" if goal["holds"] else ", missed"
        rows.append(
            f"| {name.replace('_', ' ')} | {100 * goal['value']:.1f} % | "
            f"at least {percent(goal['least'])}{most}{word} |"
        )
    return "\n".join(rows)


def section(preset: str, found: dict[str, Any]) -> str:
    """Everything about one preset."""
    optimum = found["optimum"]
    shares = " / ".join(percent(one["mean"]) for one in optimum["shots_share"].values())
    rows = ["| | excess over the optimum's cost | |", "|---|---|---|"]
    rows += [
        f"| {name.replace('_', ' ')} | {interval(one, 'excess', '%')} | {one['choice']} |"
        for name, one in found["excess"].items()
    ]
    errors = [
        "| at half of always-8's energy | mean error | energy for the error of blind choices |"
    ]
    errors += ["|---|---|---|"]
    errors += [
        f"| {FRONTS[name][0]} | {interval(one, 'mean', 'm')} | "
        f"{interval(found['energy_at_equal_error'][name], 'mean', '%')} |"
        for name, one in found["error_at_half_energy"].items()
    ]
    families = ["| best action by family | 2 DCS | 4 DCS | 8 DCS |", "|---|---|---|---|"]
    families += [
        f"| {family.replace('_', ' ')} | {' | '.join(percent(s) for s in each)} |"
        for family, each in found["families"].items()
    ]
    fixed = ", ".join(f"{one['depth_mae_m']:.2f}" for one in found["fixed"].values())
    return "\n\n".join(
        [
            f"## `{preset}`",
            purpose(preset),
            f"{found['drives']} test drives of {found['clips']} clips. The clairvoyant optimum "
            f"takes 2 / 4 / 8 DCS in {shares} of the frames, at "
            f"{percent(optimum['laser_energy_share'])} of always-8's laser energy and a mean error "
            f"of {interval(optimum['depth_mae_m'], 'mean', 'm')}; always 2, 4, 8 DCS have {fixed} "
            f"m. Heat holds back always-8 in {percent(found['held_back_drives_share'])} of the "
            "drives.",
            "\n".join(rows),
            "\n".join(errors),
            "\n".join(families),
            goals(found),
        ]
    )


def paint(measured: dict[str, dict[str, Any]]) -> None:
    """The fronts of each preset, error against laser energy."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, len(measured), figsize=(3.1 * len(measured), 3.4))
    for axis, (preset, found) in zip(axes, measured.items(), strict=True):
        for name, (label, color, style) in FRONTS.items():
            points = found["fronts"][name]
            axis.plot(
                [100 * point["laser_energy_share"] for point in points],
                [point["depth_mae_m"] for point in points],
                style,
                color=color,
                label=label,
                linewidth=1.6,
            )
        for shots, share in zip(found["fixed"], (25, 50, 100), strict=True):
            error_m = found["fixed"][shots]["depth_mae_m"]
            axis.plot(share, error_m, "o", color="#111827", markersize=4)
            axis.annotate(shots, (share, error_m), textcoords="offset points", xytext=(4, 4))
        axis.set_title(preset.replace("_", " "), fontsize=10)
        axis.set_xlabel("laser energy, % of always 8", fontsize=9)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    axes[0].set_ylabel("mean depth error, m", fontsize=9)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncol=4, fontsize=9, frameon=False)
    figure.tight_layout(rect=(0, 0.08, 1, 1))
    figure.savefig(PICTURE, dpi=110)


HEAD = """# What there is to win

Made by `python docs/problem_page.py DIR` from what `shotenv problem --env configs/env/PRESET.yaml
--json DIR/PRESET.json` measures (kept in `docs/problem/`, from which it is made without `DIR`):
every action in every frame of the test drives of the bank `pocket` (`strong`: `starter`), with
the drive's own noise, and from these tables what policies that know everything, nothing, or what
the sensor tells could reach. Cost is the weighted sum of the reward's terms; intervals are 95 %
bootstrap intervals over clips. Foresight is a small network that foresees each action's error
from gray image, unwrapping network and the drive's settings, trained on train drives, told what
looking showed (how far 2 and 4 of the 8 samples of the last frame were from all of them) or not.
The goals are those of the default problem, or for `hot` of one in which heat binds; the other
presets are what they are for and need not meet them. At the end stands what plain learners make
of the default problem.

![Error against laser energy by preset; dots are always 2, 4 and 8 DCS](images/problem.png)
"""


def learners(found: dict[str, Any]) -> str:
    """What agents of stable-baselines3 with library defaults learn."""
    rows = [
        "| | over always 2 | over always 4 | over always 8 | over itself without looking | error | "
        "2 / 4 / 8 DCS |",
        "|---|---|---|---|---|---|---|",
    ]
    for run in found["runs"]:
        pairs = [*run["over"].values(), run["over_itself_without_looking"]]
        differences = " | ".join(difference(one) for one in pairs)
        shares = " / ".join(percent(one) for one in run["shots_share"])
        rows.append(
            f"| {run['algorithm']}, seed {run['seed']} | {differences} | "
            f"{run['depth_mae_m']:.2f} m | {shares} |"
        )
    return "\n\n".join(
        [
            "## Plain learners",
            "PPO and DQN of stable-baselines3 with the library's defaults but for the discount, "
            f"trained for {found['steps']:,} frames of one environment (`python "
            f"docs/learnability.py`), on {found['drives']} test drives: difference of the return "
            "of a drive, with its 95 % interval over clips. Without looking, the features that "
            "tell what a longer acquisition showed are 0.",
            "\n".join(rows),
        ]
    )


def difference(one: dict[str, float]) -> str:
    """A difference of returns and its interval."""
    return f"{one['difference']:+.0f} ({one['low']:+.0f} to {one['high']:+.0f})"


def keep_numbers(folder: Path) -> None:
    """Keep what the page needs of the files in `folder`."""
    NUMBERS.mkdir(exist_ok=True)
    for preset in PRESETS:
        found = json.loads((folder / f"{preset}.json").read_text(encoding="utf-8"))
        used = {name: value for name, value in found.items() if name not in UNUSED}
        text = json.dumps(used, indent=1) + "\n"
        (NUMBERS / f"{preset}.json").write_text(text, encoding="utf-8")
    shutil.copyfile(folder / f"{LEARNERS}.json", NUMBERS / f"{LEARNERS}.json")


def kept(name: str) -> dict[str, Any]:
    """The numbers kept under a name."""
    return json.loads((NUMBERS / f"{name}.json").read_text(encoding="utf-8"))


def measured() -> dict[str, dict[str, Any]]:
    """The numbers kept of each preset."""
    return {preset: kept(preset) for preset in PRESETS}


def page(found: dict[str, dict[str, Any]], learned: dict[str, Any]) -> str:
    """The page of these numbers."""
    sections = [section(*item) for item in found.items()]
    return "\n\n".join([HEAD.rstrip(), *sections, learners(learned)]) + "\n"


def filled_readme(text: str, found: dict[str, Any]) -> str:
    """The README with its table, between `<!-- problem -->` and `<!-- end -->`, of these numbers.

    Raises
    ------
    ValueError
        It has no place for the table, or several.
    """
    rows = [
        "| mean depth error at half of always-8's laser energy | | 95 % interval |",
        "|---|---|---|",
    ]
    for name, words in ROWS.items():
        one = found["error_at_half_energy"][name]
        rows.append(f"| {words} | {one['mean']:.2f} m | {one['low']:.2f} to {one['high']:.2f} m |")
    return marked(text, "problem", "\n".join(rows), README)


def main() -> None:
    """Write page, picture and the README's table."""
    if len(sys.argv) > 1:
        keep_numbers(Path(sys.argv[1]))
    found = measured()
    PAGE.write_text(page(found, kept(LEARNERS)), encoding="utf-8")
    readme = filled_readme(README.read_text(encoding="utf-8"), found["default"])
    README.write_text(readme, encoding="utf-8")
    paint(found)


if __name__ == "__main__":
    main()
