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

DOCS = Path(__file__).parent
PAGE = DOCS / "results.md"
LEAST_SEEDS: Final = 5
"""Of a study whose numbers count."""
SHOWN: Final = {
    "regression": "#c2410c",
    "ppo": "#1d4ed8",
    "dqn": "#9333ea",
    "qrdqn": "#be185d",
    "ridge": "#a16207",
    "look_and_weigh": "#0f766e",
    "snr_threshold": "#65a30d",
    "blind": "#64748b",
    "optimum": "#1e293b",
}
"""Rows of the picture and their colours, those of the report's charts where it has them."""


def interval(row: dict[str, Any], measure: str, form: str) -> str:
    """Interquartile mean and interval; a dash where there is none."""
    if measure not in row:
        return "-"
    scale, digits = {"%": (100, 0), "m": (1, 2), "": (1, 0)}[form]
    mean, low, high = (scale * row[measure][key] for key in ("iqm", "low", "high"))
    return f"{mean:.{digits}f} {form} ({low:.{digits}f} to {high:.{digits}f})".replace("  ", " ")


def improvement(table: dict[str, Any], name: str) -> str:
    """Probability that the first row does better than this one."""
    if name == table["best"]:
        return ""
    one = table["improvement"][table["best"]][name]
    told = f"{100 * one['probability']:.0f} % ({100 * one['low']:.0f} to {100 * one['high']:.0f})"
    return told if one["significant"] else f"{told}, no significant difference"


def rows_of(table: dict[str, Any]) -> list[str]:
    """Names of the rows, the least error at half the energy first."""
    rows = table["rows"]
    return sorted(rows, key=lambda name: rows[name]["error_at_half_energy"]["iqm"])


def section(preset: str, table: dict[str, Any]) -> str:
    """A preset and its table."""
    lines = [
        "| policy | seeds | gap closed | error at half the energy (median; mean) | "
        "energy at equal error | return | the first does better |",
        "|---|---|---|---|---|---|---|",
    ]
    for name in rows_of(table):
        row = table["rows"][name]
        at_half = row["error_at_half_energy"]
        lines.append(
            f"| {name.replace('_', ' ')} | {len(at_half['seeds'])} | "
            f"{interval(row, 'gap_closed', '%')} | "
            f"{interval(row, 'error_at_half_energy', 'm')} "
            f"({at_half['median']:.2f}; {at_half['mean']:.2f}) | "
            f"{interval(row, 'energy_at_equal_error', '%')} | {interval(row, 'return', '')} | "
            f"{improvement(table, name)} |"
        )
    env = table["env"]
    return "\n\n".join(
        [
            f"## `{preset}`",
            f"{table['drives']} drives of {table['clips']} clips of the bank "
            f"`{env['bank']}` (digest `{table['bank']}`), {env['frames_per_drive']} frames each. "
            f"Returns are at a price of power of {table['price']:.2g}.",
            "\n".join(lines),
        ]
    )


def page(found: dict[str, Any], picture: str, command: str) -> str:
    """The whole page."""
    plan, tables = found["plan"], found["presets"]
    seeds = ", ".join(map(str, plan["seeds"]))
    versions = ", ".join(f"{name} {number}" for name, number in found["versions"].items())
    ablations = "; ".join(
        f"{row.replace('_', ' ')}: {one['policy']} that is not shown {', '.join(one['unseen'])}"
        for row, one in plan["ablations"].items()
    )
    parts = [
        "# Results",
        f"Made by `{command}`: {len(tables)} presets, training seeds {seeds}, "
        f"{found['seconds'] / 3600:.1f} hours of one core in all. {versions}.",
    ]
    if len(plan["seeds"]) < LEAST_SEEDS:
        parts.append(
            f"**These numbers only show that the study works:** {len(plan['seeds'])} training "
            f"seeds and {plan['study']['drives']} drives; a study that counts has "
            f"{LEAST_SEEDS} seeds or more."
        )
    confidence = f"{plan['study']['confidence']:.0%}".replace("%", " %")
    parts += [
        "Every policy plays the same test drives with the same noise, once at each price of power. "
        "*Gap closed*: 0 is the best mixture that looks at nothing, 1 the optimum that knows all, "
        "at the same energy, averaged over .3 to .9 of the energy of 8 DCS in every frame. *Energy "
        "at equal error* is that at which a policy errs as little as 8 DCS in every frame with a "
        "laser that never trips, as a share of its energy; 100 % where it is never as good. A row "
        "is the interquartile mean over its training seeds (of 5 the middle 3); brackets are "
        f"{confidence} intervals that resample seeds and, in common for all, clips. *The first "
        "does better*: probability that the row at the top has a higher return on a clip, over "
        "clips and pairs of seeds ([Agarwal et al. 2021](https://arxiv.org/abs/2108.13264)). It "
        "is at the top by the drives that are shown, which favours it. `ridge` is a linear "
        "regression on the frames that the regression learns from, and `random` draws from all "
        "three actions: what a learned policy must beat. Rules are tuned on validation drives "
        "at each price.",
        *([f"Not shown in training or play: {ablations}."] if ablations else []),
        f"![Depth error against laser energy by preset: every point was played]({picture})",
        *(section(preset, table) for preset, table in tables.items()),
        SUBMIT,
    ]
    return "\n\n".join(parts) + "\n"


SUBMIT: Final = """## Your policy on this board

Add a line to `policies` of `configs/study/results.yaml`: the path of an agent's YAML file, which is
trained with each seed; or the folder of a scheduler that `shotenv train` saved; or a family of your
own, a few lines in `agents/policies/practice.py`. `shotenv study` then plays it alone, since what
stands is not played again. To have it re-scored, open a pull request with the line and the file:
whoever merges it runs the same command, and row and digest must come out the same. Train and tune
on train and validation clips; test clips are for playing."""


def paint(tables: dict[str, Any], path: Path) -> None:
    """Fronts of each preset: all points that were played, and lines along the best of them."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        1, len(tables), figsize=(max(3.1 * len(tables), 7.0), 3.8), squeeze=False
    )
    for axis, (preset, table) in zip(axes[0], tables.items(), strict=True):
        # Of another study there may be none of them: its learners, then.
        names = [name for name in SHOWN if name in table["fronts"]]
        names += [name for name in rows_of(table)[:3] if name not in names]
        for number, name in enumerate(names):
            color = SHOWN.get(name, f"C{number}")
            for seed, points in enumerate(table["fronts"][name]):
                energy = [100 * point["laser_energy_share"] for point in points]
                error_m = [point["depth_mae_m"] for point in points]
                axis.plot(energy, error_m, ".", color=color, markersize=3, alpha=0.5)
                best = undominated(energy, error_m)
                style = {"blind": ":", "optimum": "--"}.get(name, "-")
                label = name.replace("_", " ") if not seed else None
                axis.plot(*best, style, color=color, linewidth=1.2, alpha=0.8, label=label)
        axis.set_title(preset.replace("_", " "), fontsize=10)
        axis.set_xlabel("laser energy, % of 8 DCS", fontsize=9)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=8)
    axes[0][0].set_ylabel("mean depth error, m", fontsize=9)
    handles = {}
    for axis in axes[0]:
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    figure.legend(
        handles.values(), handles.keys(), loc="lower center", ncol=5, fontsize=8, frameon=False
    )
    figure.tight_layout(rect=(0, 0.13, 1, 1))
    figure.savefig(path, dpi=110)


def undominated(energy: list[float], error_m: list[float]) -> tuple[list[float], list[float]]:
    """Points that no other beats in both, energy rising."""
    best: list[tuple[float, float]] = []
    for point in sorted(zip(energy, error_m, strict=True)):
        if not best or point[1] < best[-1][1]:
            best.append(point)
    return [point[0] for point in best], [point[1] for point in best]


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
