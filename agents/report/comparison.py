"""Several evaluations on one page: of sensors, unwrapping networks, presets or schedulers."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, Final

import plotly.graph_objects as go

from agents.report.answer import BLIND, percent, verdict
from agents.report.charts import ACCENT, AXIS, INK, figure_html, point_told, styled, undominated
from agents.report.results import RESULTS, read_json
from agents.report.template import CANNOT_SHOW, page_of
from unwrap.support import write_text

MARK: Final = "shotenv comparison of evaluations"
"""What a page of this kind says at its start, and no other file does."""
COLORS: Final = (ACCENT, "#1d4ed8", "#0f766e", "#9333ea", "#a16207", "#be185d", "#334155")
OF_DRIVES: Final = {
    "bank": ("config", "env", "bank"),
    "split": ("config", "study", "split"),
    "seeds": ("seeds",),
    "frames_per_drive": ("config", "env", "frames_per_drive"),
    "families": ("config", "env", "families"),
}
"""What says which drives were played, and where results have it."""
MISSING: Final = "none"


def write_comparison(folders: Sequence[Path], out: Path) -> Path:
    """Write a page that compares the evaluations in `folders`, and return its path.

    Raises
    ------
    ValueError
        A folder is named twice; results of one are missing, damaged or of another schema; or
        `out` is there and no comparison. Nothing is written then.
    """
    resolved = [folder.resolve() for folder in folders]
    for folder in folders:
        if resolved.count(folder.resolve()) > 1:
            raise ValueError(f"results has {folder} twice; expected each evaluation once")
    check_replaceable(out)
    every = {
        name: read_json(folder / RESULTS)
        for name, folder in zip(short_names(resolved), folders, strict=True)
    }
    for results, folder in zip(every.values(), folders, strict=True):
        check_schema(results, folder)
    write_text(out, render_comparison(every))
    return out


def check_replaceable(out: Path) -> None:
    """Refuse to overwrite what is no comparison.

    Raises
    ------
    ValueError
        It is something else.
    """
    if not out.exists():
        return
    begin = ""
    if out.is_file():
        with out.open(encoding="utf-8", errors="replace") as file:
            begin = file.read(1000)
    if MARK not in begin:
        raise ValueError(
            f"out is {out}, which is there and no comparison of evaluations; nothing was "
            "overwritten, `--out` takes another file"
        )


def check_schema(results: dict[str, Any], folder: Path) -> None:
    """Refuse results in which something is missing that the page shows.

    Raises
    ------
    ValueError
        They are of another version.
    """
    try:
        render_comparison({folder.name: results})
    except (*CANNOT_SHOW, ValueError) as error:
        raise ValueError(
            f"{folder} holds results that this version cannot show ({error!r}); "
            "`shotenv evaluate` writes them anew"
        ) from None


def render_comparison(every: Mapping[str, dict[str, Any]]) -> str:
    """The page as text, of results by the names of their evaluations."""
    return page_of(
        "comparison.html.jinja",
        mark=MARK,
        colors=dict(zip(every, cycle(COLORS), strict=False)),
        answers={name: verdict(results) for name, results in every.items()},
        drives_told=drives_told(list(every.values())),
        settings=differing([settings_of(results) for results in every.values()]),
        measures=measures_told(list(every.values())),
        confidences=sorted({percent(results["confidence"]) for results in every.values()}),
        fronts=figure_html(fronts_of_all(every)),
    )


def short_names(folders: Sequence[Path]) -> list[str]:
    """Names of folders, with as much of their paths as tells them apart.

    Examples
    --------
    >>> short_names([Path("/runs/hot/evaluation"), Path("/runs/paper/evaluation")])
    ['hot/evaluation', 'paper/evaluation']
    """
    for parts in range(1, max(len(folder.parts) for folder in folders)):
        names = ["/".join(folder.parts[-parts:]) for folder in folders]
        if len(set(names)) == len(names):
            return names
    return [str(folder) for folder in folders]


def drives_told(every: Sequence[dict[str, Any]]) -> str:
    """Whether all were played on the same drives, in words."""
    found = [{name: _at(results, path) for name, path in OF_DRIVES.items()} for results in every]
    differ = [name for name in OF_DRIVES if any(one[name] != found[0][name] for one in found)]
    if differ:
        return (
            f"These evaluations are on different drives: {', '.join(differ)} differ. What differs "
            "between columns is thus drives, too; no difference here is paired, and none has an "
            "interval."
        )
    return (
        f"All evaluations are on the same {found[0]['split']} drives of bank {found[0]['bank']}. "
        "Each interval is still that of its own evaluation: differences between columns are not "
        "paired here and have none."
    )


def settings_of(results: dict[str, Any]) -> dict[str, Any]:
    """Everything that was set, by its name, with what it was run with."""
    versions = {f"version of {name}": value for name, value in results["versions"].items()}
    configured = dict(_flat(results["config"]))
    # The drives that are judged are of the study's split, whatever the environment's is.
    configured.pop("env.split", None)
    return {**configured, "learnt by": results["algorithm"], **versions}


def differing(settings: Sequence[dict[str, Any]]) -> dict[str, list[str]]:
    """Of each setting that is not the same in all its values as text.

    Examples
    --------
    >>> differing([{"a": 1, "b": [1, 2]}, {"a": 1, "b": None, "c": "x"}])
    {'b': ['[1, 2]', 'null'], 'c': ['none', 'x']}
    """
    names = dict.fromkeys(name for one in settings for name in one)
    found = {name: [_as_text(one, name) for one in settings] for name in names}
    return {name: texts for name, texts in found.items() if len(set(texts)) > 1}


def measures_told(every: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of the table: what is measured, and of each evaluation its value and interval."""
    eight = [results["answer"]["always_8"] for results in every]
    rows: list[dict[str, Any]] = [
        {
            "title": "Depth error of always 8 DCS, m",
            "cells": [(f"{one['depth_mae_m']:.2f}", "") for one in eight],
        }
    ]
    own = [results["answer"]["measures"][results["answer"]["scheduler"]] for results in every]
    blind = [results["answer"]["measures"][BLIND] for results in every]
    for title, measure, number, of in (
        ("Energy saved, same error", "energy_saved_at_equal_error", percent, own),
        ("Energy saved, 10 % more error", "energy_saved_at_10_percent_more", percent, own),
        ("Energy saved, 25 % more error", "energy_saved_at_25_percent_more", percent, own),
        ("Laser life, 10 % more error, times", "life_factor_at_10_percent_more", _tenths, own),
        ("Laser cooler, 10 % more error, K", "cooler_k_at_10_percent_more", _tenths, own),
        ("Error at half the energy, m", "error_at_half_energy", _hundredths, own),
        ("the same, best mixture of fixed choices", "error_at_half_energy", _hundredths, blind),
        ("less than that mixture", "below_blind_at_half_energy", percent, own),
        ("Gap closed to the optimum", "gap_closed", percent, own),
        ("Hypervolume, m", "hypervolume", _hundredths, own),
    ):
        cells = [
            (
                number(one[measure]["mean"]),
                f"{number(one[measure]['low'])} to {number(one[measure]['high'])}",
            )
            # Where the optimum is not known there is no gap.
            if measure in one
            else (MISSING, "")
            for one in of
        ]
        rows.append({"title": title, "cells": cells})
    return rows


def fronts_of_all(every: Mapping[str, dict[str, Any]]) -> go.Figure:
    """Error against energy of each scheduler, and dotted of what looks at nothing.

    Energy is a share of that of the evaluation's own always 8.
    """
    figure = go.Figure()
    for (name, results), color in zip(every.items(), cycle(COLORS), strict=False):
        answer = results["answer"]
        whole = answer["always_8"]["laser_energy_share"]
        for front, words, chosen in (
            (BLIND, "fixed choices, mixed", False),
            (answer["scheduler"], "scheduler", True),
        ):
            rows = sorted(results["fronts"][front], key=lambda row: row["laser_energy_share"])
            best = undominated(rows)
            line = {"color": color, "width": 2.4 if chosen else 1.2}
            figure.add_scatter(
                x=[row["laser_energy_share"] / whole for row in best],
                y=[row["depth_mae_m"] for row in best],
                mode="lines",
                line={**line, "dash": "solid" if chosen else "dot"},
                legendgroup=f"{name} {front}",
                showlegend=False,
                hoverinfo="skip",
            )
            figure.add_scatter(
                x=[row["laser_energy_share"] / whole for row in rows],
                y=[row["depth_mae_m"] for row in rows],
                mode="markers",
                marker={
                    "color": color,
                    "size": 9 if chosen else 6,
                    "symbol": "circle" if chosen else "x-thin-open",
                },
                legendgroup=f"{name} {front}",
                name=f"{name}: {words}",
                customdata=[point_told(row) for row in rows],
                hovertemplate=f"%{{x:.1%}}, %{{y:.3f}} m<br>%{{customdata}}<extra>{name}</extra>",
            )
    figure.add_vline(x=1.0, line={"color": INK, "width": 1, "dash": "dot"})
    figure.update_xaxes(title="laser energy, share of its always 8 DCS", tickformat=".0%", **AXIS)
    figure.update_yaxes(title="mean absolute depth error, m", rangemode="tozero", **AXIS)
    legend = {"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"}
    return styled(figure, height=540, legend=legend)


def _at(results: dict[str, Any], path: tuple[str, ...]) -> Any:
    value: Any = results
    for name in path:
        value = value[name]
    return value


def _flat(settings: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Settings of sections within sections, by names such as `env.laser.trip_k`."""
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _as_text(settings: dict[str, Any], name: str) -> str:
    value = settings.get(name, MISSING)
    return value if isinstance(value, str) else json.dumps(value)


def _tenths(value: float) -> str:
    return f"{value:.1f}"


def _hundredths(value: float) -> str:
    return f"{value:.2f}"
