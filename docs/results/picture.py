"""Fronts of a study, as they were played."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from results.rows import rows_of

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
FEW: Final = 3
"""Fewest rows, with those of blind choices and of the optimum, that need no others beside them."""


def paint(tables: dict[str, Any], path: Path) -> None:
    """Fronts of each preset: all points that were played, and lines along the best of them."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(
        1, len(tables), figsize=(max(4.4 * len(tables), 7.0), 4.6), squeeze=False
    )
    for axis, (preset, table) in zip(axes[0], tables.items(), strict=True):
        names = [name for name in SHOWN if name in table["fronts"]]
        # Of another table there may be few of them: its best, then.
        if len(names) <= FEW:
            names += [name for name in rows_of(table)[:3] if name not in names]
        for number, name in enumerate(names):
            color = SHOWN.get(name, f"C{number}")
            for seed, points in enumerate(table["fronts"][name]):
                energy = [100 * point["laser_energy_share"] for point in points]
                error_m = [point["depth_mae_m"] for point in points]
                axis.plot(energy, error_m, ".", color=color, markersize=2, alpha=0.4)
                best = undominated(energy, error_m)
                style = {"blind": ":", "optimum": "--"}.get(name, "-")
                label = name.replace("_", " ") if not seed else None
                # One training strong, the others thin: they lie close together.
                width, alpha = (0.5, 0.4) if seed else (1.5, 0.9)
                axis.plot(*best, style, color=color, linewidth=width, alpha=alpha, label=label)
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
