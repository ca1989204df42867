"""The results table as a page: what was run, the methods, and a table for each split and truth."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from importlib import resources
from typing import Any

from jinja2 import Environment, StrictUndefined

from unwrap.comparison.catalogue import ENTRIES
from unwrap.comparison.table_trainings import TableConfig
from unwrap.signal import SensorDescription, unambiguous_range_m

Row = dict[str, Any]
COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("rmse_m", "RMSE m", ".2f"),
    ("mae_m", "MAE m", ".2f"),
    ("irmse_per_km", "iRMSE 1/km", ".1f"),
    ("sq_rel_kitti", "SqRel (KITTI)", ".3f"),
    ("sq_rel_eigen", "SqRel (Eigen)", ".3f"),
    ("abs_rel", "AbsRel", ".3f"),
    ("silog", "SILog", ".1f"),
    ("accuracy_percent", "acc. %", ".2f"),
    ("precision_percent", "prec. %", ".2f"),
    ("wrap_accuracy", "right wrap", ".4f"),
    ("p95_m", "p95 m", ".2f"),
    ("class_accuracy", "class acc.", ".3f"),
    ("class_precision", "class prec.", ".3f"),
    ("calibration_error", "ECE", ".3f"),
)
"""Key of a row, head of its column, format."""

PUBLISHED = """\
| DCS | network | RMSE | iRMSE | SqRel | AbsRel | pred. acc., prec. % | corr. acc., prec. % |
|---|---|---|---|---|---|---|---|
| 4 | TofRegNet | 2.02 | 4.3342 | 0.6032 | 0.6084 | 98.66, 99.27 | 94.39, 99.06 |
| 4 | TofSegNet | 2.01 | 4.3134 | 0.6028 | 0.5969 | 99.56, 99.99 | 94.44, 99.08 |
| 2 | TofRegNet | 1.81 | 4.2654 | 0.4974 | 0.5692 | 98.66, 99.27 | 94.93, 98.63 |
| 2 | TofSegNet | 1.78 | 4.2447 | 0.4878 | 0.5530 | 99.61, 99.99 | 95.05, 98.64 |
"""
"""As printed by Nagiub et al. (2023), of their own recordings."""
HEADINGS = {"clip": "Split by clip", "frame": "Split by frame", "shift": "Held-out families"}
TEMPLATE = "unwrapping.md.jinja"
FULL = TableConfig()
"""The paper's size and length."""


def render_page(config: TableConfig, sensor: SensorDescription, rows: Sequence[Row]) -> str:
    """The page in Markdown; all that it says of a run follows from the arguments.

    Parameters
    ----------
    config : TableConfig
    sensor : SensorDescription
        The sensor that `config` names.
    rows : sequence of dict
        Of `score_methods`, each with its `split` and `truth`.
    """
    source = resources.files("unwrap.comparison") / TEMPLATE
    template = Environment(undefined=StrictUndefined, keep_trailing_newline=True).from_string(
        source.read_text(encoding="utf-8")
    )
    return template.render(
        config=config.model_dump(mode="json"),
        # Whoever reads a table of a short training must not take its ranks for those of the papers.
        small=config.width < FULL.width or config.epochs < FULL.epochs or config.stride > 1,
        splits={row["split"] for row in rows},
        truths={row["truth"] for row in rows},
        entries=[
            entry for entry in ENTRIES if any(row["method"].startswith(entry.label) for row in rows)
        ],
        sensor=sensor,
        unambiguous_m=unambiguous_range_m(sensor.f1_hz),
        tables=tables(rows),
        published=PUBLISHED,
    )


def tables(rows: Sequence[Row]) -> str:
    """Markdown: a table for each split and truth, in the order in which they come."""
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["split"], row["truth"]), []).append(row)
    return "\n".join(
        f"### {HEADINGS[split]}, {truth} truth: {of[0]['frames']:g} frames\n\n{_table(of)}"
        for (split, truth), of in groups.items()
    )


def _table(rows: Iterable[Row]) -> str:
    heads = ("DCS", "method", "merge", *(head for _, head, _ in COLUMNS))
    lines = [heads, ["---"] * len(heads)]
    # A stable sort: with as many samples, methods stay in the order in which they were planned.
    for row in sorted(rows, key=lambda row: row["shots"]):
        numbers = [format(row[key], form) if key in row else "" for key, _, form in COLUMNS]
        lines.append([str(row["shots"]), row["method"], row["merge"], *numbers])
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
