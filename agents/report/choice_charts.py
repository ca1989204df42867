"""What a scheduler asks for, as heat maps over pairs of what it observed."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import plotly.graph_objects as go

from agents.report.charts import AXIS, SHOT_COLORS, styled
from unwrap.signal import Shots


def choice_map(told: dict[str, Any]) -> go.Figure:
    """Mean of the samples asked for in each cell of a map of `choice_maps`; none, no colour."""
    x, y = told["x"], told["y"]
    counts = np.array(told["counts"])
    frames = counts.sum(axis=-1)
    # Empty cells divide by 1 and are left out: plotly draws nothing where there is no number.
    mean = np.where(frames > 0, counts @ list(Shots) / np.maximum(frames, 1), np.nan)
    lowest, highest = min(Shots), max(Shots)
    figure = go.Figure()
    figure.add_heatmap(
        # By number of the cell: cells are equally wide, whatever they stand for.
        x=np.arange(frames.shape[1]) + 0.5,
        y=np.arange(frames.shape[0]) + 0.5,
        z=mean,
        zmin=lowest,
        zmax=highest,
        colorscale=[
            ((shots - lowest) / (highest - lowest), color) for shots, color in SHOT_COLORS.items()
        ],
        customdata=[
            [_cell_told(at_x, at_y, counts[j, i]) for i, at_x in enumerate(_cells_of(x))]
            for j, at_y in enumerate(_cells_of(y))
        ],
        hoverongaps=False,
        hovertemplate="%{customdata}<extra></extra>",
        xgap=1,
        ygap=1,
        colorbar={
            "title": {"text": "samples asked for, mean", "side": "top"},
            "orientation": "h",
            "tickvals": list(Shots),
            "thickness": 10,
            "len": 0.6,
            "y": -0.28,
            "yanchor": "top",
        },
    )
    figure.update_xaxes(**_axis(x, frames.shape[1]))
    figure.update_yaxes(**_axis(y, frames.shape[0]))
    return styled(figure, height=440, left=65).update_layout(margin={"b": 120, "r": 10})


def _axis(told: dict[str, Any], cells: int) -> dict[str, Any]:
    """Ticks between the cells, or at their middles where each stands for one number."""
    if "marks" in told:
        values, texts = np.arange(cells) + 0.5, told["marks"]
    else:
        # Past the last edge that is a number lies everything above.
        values, texts = np.arange(cells + 1.0), told["edges"]
    return {
        "title": told["title"] + (f", {told['unit']}" if told["unit"] else ""),
        "tickvals": values.tolist(),
        "ticktext": ["" if text is None else f"{text:g}" for text in texts],
        "range": [0, cells],
        "tickangle": 0,
        **AXIS,
        "showgrid": False,
    }


def _cells_of(told: dict[str, Any]) -> list[str]:
    """What each cell of an axis stands for, in words."""
    title, unit = told["title"], f" {told['unit']}" if told["unit"] else ""
    if "marks" in told:
        return [f"{title} {mark:g}{unit}" for mark in told["marks"]]
    return [
        f"{title} {low:g}{unit} and more" if high is None else f"{title} {low:g} to {high:g}{unit}"
        for low, high in pairwise(told["edges"])
    ]


def _cell_told(x: str, y: str, counts: np.ndarray) -> str:
    frames = int(counts.sum())
    shares = ", ".join(
        f"{shots} DCS {count / max(frames, 1):.0%}"
        for shots, count in zip(Shots, counts, strict=True)
    )
    return f"{x}<br>{y}<br><b>{frames} frames</b>: {shares}"
