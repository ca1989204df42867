"""One drive over time: a chart of it, and the numbers that its slider tells."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from agents.report.charts import ACCENT, AXIS, INK, LEGEND, MUTED, SHOT_COLORS, family_label, styled
from agents.report.results import OPTIMUM, TODAY, label
from unwrap.signal import Shots

OFF_COLOR: Final = "#fb7185"
LEVELS: Final = (0, *Shots)
"""Samples taken; 0: the laser was off."""
# Of the families that networks and schedulers are trained on; others share one gray.
FAMILY_COLORS = {
    "sunny_road": "#fde68a",
    "overcast_street": "#d6dde6",
    "garage": "#e7d3c0",
    "tunnel": "#cfd3dd",
    "night_road": "#b7bfdc",
}


def names_of(record: dict[str, Any], scheduler: str) -> dict[str, str]:
    """Policies of the drive, what matters most first, and what the chart calls them, in short."""
    short = {scheduler: label(scheduler), OPTIMUM: "Optimum", TODAY: label(TODAY)}
    return {name: text for name, text in short.items() if name in record["policies"]}


def timeline(record: dict[str, Any], scheduler: str) -> go.Figure:
    """Shots, error, laser temperature and energy so far of one drive under each policy.

    The last of its shapes is the cursor that the page's slider moves.
    """
    figure = make_subplots(
        rows=4,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.035,
        row_heights=[0.16, 0.28, 0.28, 0.28],
    )
    seconds = np.arange(len(record["family"])) / record["frame_rate_hz"]
    # plotly draws the first row lowest, and the last line above the others.
    names = dict(reversed(names_of(record, scheduler).items()))
    shots = np.array([record["policies"][name]["shots"] for name in names])
    figure.add_heatmap(
        x=seconds,
        y=list(names.values()),
        z=np.searchsorted(LEVELS, shots),
        customdata=np.where(shots > 0, np.char.add(shots.astype(str), " DCS"), "laser off"),
        colorscale=_in_steps([OFF_COLOR, *SHOT_COLORS.values()]),
        zmin=-0.5,
        zmax=len(LEVELS) - 0.5,
        ygap=2,
        showscale=False,
        hovertemplate="%{customdata}<extra>%{y}</extra>",
        row=1,
        col=1,
    )
    looks = {
        TODAY: {"color": MUTED, "width": 1.3},
        OPTIMUM: {"color": INK, "width": 1.3, "dash": "dot"},
        scheduler: {"color": ACCENT, "width": 1.9},
    }
    for name, text in names.items():
        played = record["policies"][name]
        drawn = (
            played["depth_mae_m"],
            np.array(played["temperature_k"]) - 273.15,
            np.cumsum(played["laser_energy_j"]),
        )
        for row, values in enumerate(drawn, start=2):
            figure.add_scatter(
                x=seconds,
                y=values,
                mode="lines",
                line=looks[name],
                name=text,
                legendgroup=name,
                showlegend=row == 2,
                row=row,
                col=1,
            )
    _limit(figure, record["trip_k"], "laser trips")
    _limit(figure, record["release_k"], "laser comes back")
    _family_bands(figure, record["family"], record["frame_rate_hz"])
    figure.update_yaxes(title="depth error, m", rangemode="tozero", row=2, **AXIS)
    figure.update_yaxes(title="laser, °C", row=3, **AXIS)
    figure.update_yaxes(title="laser so far, J", rangemode="tozero", row=4, **AXIS)
    figure.update_xaxes(showgrid=False, zeroline=False)
    figure.update_xaxes(title="time in the drive, s", row=4)
    legend = LEGEND | {"y": 1.06, "traceorder": "reversed"}
    figure.update_layout(hovermode="x", legend=legend)
    line = {"color": INK, "width": 1}
    figure.add_shape(type="line", x0=0, x1=0, y0=0, y1=1, yref="paper", line=line)
    return styled(figure, height=760, left=100, top=80)


def rows_told(record: dict[str, Any], scheduler: str) -> list[dict[str, Any]]:
    """Of each policy what the slider tells of every frame."""
    return [
        {
            "label": text,
            "shots": played["shots"],
            "mae": played["depth_mae_m"],
            "celsius": [round(kelvin - 273.15, 2) for kelvin in played["temperature_k"]],
            "margin": [round(record["trip_k"] - kelvin, 2) for kelvin in played["temperature_k"]],
            "energy": np.cumsum(played["laser_energy_j"]).round(3).tolist(),
        }
        for name, text in names_of(record, scheduler).items()
        for played in [record["policies"][name]]
    ]


def _in_steps(colors: list[str]) -> list[tuple[float, str]]:
    """A colour scale without transitions, each colour over an equal part."""
    ends = np.linspace(0.0, 1.0, len(colors) + 1).tolist()
    parts = zip(ends, ends[1:], colors, strict=False)
    return [(end, color) for low, high, color in parts for end in (low, high)]


def _limit(figure: go.Figure, temperature_k: float, text: str) -> None:
    figure.add_hline(
        y=temperature_k - 273.15,
        line={"color": INK, "width": 1, "dash": "dot"},
        annotation={"text": text, "font": {"size": 11, "color": MUTED}},
        annotation_position="top left",
        row=3,
        col=1,
    )


def _family_bands(figure: go.Figure, families: list[str], frame_rate_hz: float) -> None:
    """Shade each clip in its family's colour, its name above where there is room."""
    edges = [i for i in range(len(families)) if i == 0 or families[i] != families[i - 1]]
    for start, end in zip(edges, [*edges[1:], len(families)], strict=True):
        band = {"x0": start / frame_rate_hz, "x1": end / frame_rate_hz}
        color = FAMILY_COLORS.get(families[start], "#e2e8f0")
        shape = {"fillcolor": color, "opacity": 0.38, "line_width": 0, "layer": "below"}
        figure.add_vrect(**band, **shape)
        # A clip of less than a twentieth of the drive is too narrow for its name.
        if end - start >= len(families) / 20:
            figure.add_annotation(
                x=(band["x0"] + band["x1"]) / 2,
                y=1.0,
                yref="paper",
                yanchor="bottom",
                text=family_label(families[start]).replace(" ", "<br>"),
                font={"size": 10, "color": MUTED},
                showarrow=False,
            )
