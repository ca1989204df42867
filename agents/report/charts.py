"""Charts of the report, as plotly figures."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from agents.report.answer import names_in_order
from agents.report.results import label
from unwrap.signal import Shots

SHOT_COLORS = {Shots.TWO: "#9ecae1", Shots.FOUR: "#4292c6", Shots.EIGHT: "#08407f"}
LEVELS = (0, *Shots)
"""Samples taken, bottom to top of the time line; 0: the laser was off."""
# The colours of the page's style sheet, `report.html.jinja`.
ACCENT, MUTED, INK = "#c2410c", "#64748b", "#1e293b"
# Of the rules, by name; others are muted.
FRONT_STYLES = {
    "look_and_hold": {"color": "#0f766e", "symbol": "diamond"},
    "look_and_weigh": {"color": "#1d4ed8", "symbol": "square"},
    "snr_threshold": {"color": "#a16207", "symbol": "triangle-up"},
    "cycle": {"color": "#9333ea", "symbol": "cross"},
    "blind": {"color": MUTED, "symbol": "x-thin-open", "dash": "dot"},
    "optimum": {"color": INK, "dash": "dash"},
}
LABEL_SHARE = 0.045
"""Share of energy that the label of a price takes of the chart's width, on a wide page."""
FIXED = ("always_2", "always_4", "always_8")
# Of the families that networks and schedulers are trained on; others share one gray.
FAMILY_COLORS = {
    "sunny_road": "#fde68a",
    "overcast_street": "#d6dde6",
    "garage": "#e7d3c0",
    "tunnel": "#cfd3dd",
    "night_road": "#b7bfdc",
}
# The first of these that the reader's machine has: nothing is loaded.
FONT = {"family": "Inter, system-ui, 'Segoe UI', Roboto, sans-serif", "size": 13, "color": INK}
AXIS = {"gridcolor": "#e2e8f0", "zeroline": False}
LEGEND = {"orientation": "h", "x": 1.0, "xanchor": "right", "y": 1.12, "yanchor": "bottom"}
CONFIG = {"displaylogo": False, "responsive": True, "displayModeBar": False}


def figure_html(figure: go.Figure) -> str:
    """The chart as a piece of HTML; plotly itself is inlined once by the page."""
    return figure.to_html(full_html=False, include_plotlyjs=False, config=CONFIG)


def fronts(results: dict[str, Any]) -> go.Figure:
    """Depth error against laser energy: every point played, the scheduler's with their prices."""
    figure, answer = go.Figure(), results["answer"]
    # What matters is drawn last, above the others.
    for name, text in reversed(names_in_order(results)):
        rows = sorted(results["fronts"][name], key=lambda row: row["laser_energy_share"])
        chosen = name == answer["scheduler"]
        style = FRONT_STYLES.get(name, {})
        color = ACCENT if chosen else style.get("color", MUTED)
        best = undominated(rows)
        # A line along the points that no other of the family beats in both; all as markers.
        figure.add_scatter(
            x=[row["laser_energy_share"] for row in best],
            y=[row["depth_mae_m"] for row in best],
            mode="lines",
            line={
                "color": color,
                "width": 2.4 if chosen else 1,
                "dash": style.get("dash", "solid"),
            },
            legendgroup=name,
            showlegend=False,
            hoverinfo="skip",
        )
        figure.add_scatter(
            x=[row["laser_energy_share"] for row in rows],
            y=[row["depth_mae_m"] for row in rows],
            mode="markers+text" if chosen else "markers",
            marker={
                "size": 10 if chosen else 6,
                "color": color,
                "symbol": style.get("symbol", "circle"),
            },
            text=prices_apart(rows) if chosen else None,
            textposition="bottom left",
            textfont={"color": color, "size": 11},
            legendgroup=name,
            name=text,
            customdata=[_point(row) for row in rows],
            hovertemplate="%{x:.1%}, %{y:.3f} m<br>%{customdata}<extra>" + text + "</extra>",
        )
    for name in FIXED:
        row = next(row for row in results["fronts"]["blind"] if row["policy"] == name)
        figure.add_annotation(
            x=row["laser_energy_share"],
            y=row["depth_mae_m"],
            text=label(name),
            font={"color": MUTED, "size": 11},
            showarrow=False,
            xanchor="left" if name == "always_2" else "center",
            yshift=13,
        )
    figure.add_hline(
        y=answer["always_8"]["depth_mae_m"], line={"color": INK, "width": 1, "dash": "dot"}
    )
    figure.update_xaxes(
        title="share of laser energy",
        tickformat=".0%",
        range=[0.2, 1.02],
        **AXIS,
    )
    figure.update_yaxes(title="mean absolute depth error, m", rangemode="tozero", **AXIS)
    # Below the chart: beside it the names would leave a phone no room for the points.
    legend = {"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top", "traceorder": "reversed"}
    return styled(figure, height=520, legend=legend)


def undominated(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of points with rising energy those that err less than all before."""
    least = np.minimum.accumulate([row["depth_mae_m"] for row in rows])
    return [row for i, row in enumerate(rows) if i == 0 or row["depth_mae_m"] < least[i - 1]]


def prices_apart(rows: list[dict[str, Any]]) -> list[str]:
    """Prices as labels of points with rising energy; none where it would cover that before."""
    labels, last = [], -np.inf
    for row in rows:
        free = row["laser_energy_share"] - last >= LABEL_SHARE
        labels.append(f"{row['price']:g}" if free else "")
        last = row["laser_energy_share"] if free else last
    return labels


def _point(row: dict[str, Any]) -> str:
    at = "" if row["price"] is None else f"price {row['price']:g}: "
    return at + textwrap.fill(label(row["policy"]), 60).replace("\n", "<br>")


def shares_by_family(results: dict[str, Any], names: tuple[str, ...]) -> go.Figure:
    """Stacked bars of each action's share in each scene family, one panel per policy."""
    figure = make_subplots(
        rows=1, cols=len(names), shared_yaxes=True, subplot_titles=[label(name) for name in names]
    )
    for column, name in enumerate(names, start=1):
        shares = {"all frames": results["policies"][name]["shots_share"]}
        shares |= results["families"][name]
        # plotly draws the first bar lowest.
        families = [_family(family) for family in reversed(shares)]
        table = np.array(list(reversed(shares.values())))
        for shots, color in SHOT_COLORS.items():
            share_of_shots = table[:, shots.action]
            figure.add_bar(
                x=share_of_shots,
                y=families,
                orientation="h",
                name=f"{shots} DCS",
                legendgroup=str(shots),
                showlegend=column == 1,
                marker={"color": color, "line": {"color": "white", "width": 1}},
                # In a narrower bar the number would not fit.
                text=[f"{share:.0%}" if share >= 0.08 else "" for share in share_of_shots],
                textposition="inside",
                insidetextanchor="middle",
                textangle=0,
                insidetextfont={"color": INK if shots == Shots.TWO else "white", "size": 12},
                hovertemplate="%{y}: %{x:.1%}<extra>" + f"{shots} DCS</extra>",
                row=1,
                col=column,
            )
    figure.update_xaxes(range=[0, 1], tickformat=".0%", showgrid=False, zeroline=False)
    figure.update_layout(barmode="stack", bargap=0.28, legend=LEGEND | {"traceorder": "normal"})
    return styled(figure, height=360, left=120, top=60)


def timeline(record: dict[str, Any], scheduler: str, fixed: str) -> go.Figure:
    """Shots, error and laser temperature of one drive, scheduler against a fixed choice."""
    figure = make_subplots(
        rows=3,
        cols=1,
        shared_xaxes=True,
        vertical_spacing=0.045,
        row_heights=[0.24, 0.38, 0.38],
    )
    seconds = np.arange(len(record["family"])) / record["frame_rate_hz"]
    for name, color, width in ((fixed, MUTED, 1.3), (scheduler, ACCENT, 1.9)):
        played = record["policies"][name]
        line = {"color": color, "width": width}
        style = {"line": line, "legendgroup": name, "mode": "lines"}
        # Shots change from frame to frame, not between: a stair, where the others are lines.
        stair = {**style, "line": {**line, "shape": "hv"}}
        levels = [LEVELS.index(shots) for shots in played["shots"]]
        figure.add_scatter(
            x=seconds, y=levels, **stair, name=label(name), showlegend=False, row=1, col=1
        )
        figure.add_scatter(
            x=seconds, y=played["depth_mae_m"], **style, name=label(name), row=2, col=1
        )
        temperature = np.array(played["temperature_k"]) - 273.15
        figure.add_scatter(
            x=seconds, y=temperature, **style, name=label(name), showlegend=False, row=3, col=1
        )
    _limit(figure, record["trip_k"], "laser trips")
    _limit(figure, record["release_k"], "laser comes back")
    _family_bands(figure, record["family"], record["frame_rate_hz"])
    names = ["off", *map(str, Shots)]
    figure.update_yaxes(
        title="shots", tickvals=list(range(len(LEVELS))), ticktext=names, row=1, **AXIS
    )
    # A little beyond the lowest and the highest level: lines on the edge would be cut in half.
    figure.update_yaxes(range=[-0.35, len(LEVELS) - 0.65], row=1)
    figure.update_yaxes(title="depth error, m", rangemode="tozero", row=2, **AXIS)
    figure.update_yaxes(title="laser, °C", row=3, **AXIS)
    figure.update_xaxes(showgrid=False, zeroline=False)
    figure.update_xaxes(title="time in the drive, s", row=3)
    figure.update_layout(hovermode="x", legend=LEGEND | {"y": 1.07})
    return styled(figure, height=650, top=80)


def styled(
    figure: go.Figure, *, height: int, left: int = 70, top: int = 20, **layout: Any
) -> go.Figure:
    """The figure in the page's font and colours, so many pixels high."""
    return figure.update_layout(
        template="none",
        font=FONT,
        height=height,
        margin={"l": left, "r": 30, "t": top, "b": 55},
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        **layout,
    )


def _family(name: str) -> str:
    return name.replace("_", " ")


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
                text=_family(families[start]).replace(" ", "<br>"),
                font={"size": 10, "color": MUTED},
                showarrow=False,
            )
