"""Charts of a camera's calibration, as plotly figures: points measured, lines by the numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from agents.report import ACCENT, AXIS, INK, LEGEND, MUTED, SHOT_COLORS, styled
from unwrap.calibration import (
    Calibration,
    Moments,
    ambient_e,
    amplitudes_of,
    drift_of_distance,
    gray_gain,
    has_electrons,
    overtone_factor,
    rad_per_m,
    taps_e,
    wall_curves,
    wall_phases,
    wiggle_columns,
)
from unwrap.signal import Shots

Array = np.ndarray
POINT, FAINT = SHOT_COLORS[Shots.FOUR], SHOT_COLORS[Shots.TWO]
BINS = 24
"""Of pixels with about as much light, whose mean is one point."""
ROUNDING_LSB2 = 1 / 12


def charts_of(found: Calibration) -> list[tuple[str, str, go.Figure]]:
    """Title, sentence and figure of everything that there are recordings of."""
    made = (
        photon_transfer_chart(found),
        ambient_chart(found),
        full_well_chart(found),
        offset_chart(found),
        ambient_offset_chart(found),
        wiggle_chart(found),
        drift_chart(found),
    )
    return [chart for chart in made if chart is not None]


def binned(across: Array, *values: Array) -> list[Array]:
    """Means of equally many points each, by ascending `across`."""
    order = np.argsort(across, kind="stable")
    parts = np.array_split(order, min(BINS, max(len(order), 1)))
    return [np.array([v[part].mean() for part in parts if len(part)]) for v in (across, *values)]


def dark_variance_lsb2(found: Calibration) -> float:
    """Variance without light by the numbers, LSB^2; NaN without them."""
    read = found.numbers.get("read_noise_e")
    gain = found.value("gain_lsb_per_e")
    return float("nan") if read is None else 2 * (gain * read.value) ** 2 + ROUNDING_LSB2


def photon_transfer_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Variance over amplitude of what the laser alone lights."""
    assumed = found.assumed
    lit = [
        r for r in found.recordings if r.setting.kind in ("still", "warm") and not r.setting.ambient
    ]
    if not lit:
        return None
    strength = found.value("harmonic_strength")
    figure, most = go.Figure(), 0.0
    for number, hz in enumerate(assumed.frequencies_hz):
        used = [r.flagged == 0 for r in lit]
        amplitude = np.concatenate(
            [
                amplitudes_of(r, strength, assumed.highest_harmonic)[number, u]
                for r, u in zip(lit, used, strict=True)
            ]
        )
        variance = np.concatenate(
            [r.variance_lsb2[number, u] for r, u in zip(lit, used, strict=True)]
        )
        x, y = binned(amplitude, variance)
        most = max(most, float(x.max(initial=0.0)))
        markers(figure, x, y, f"{hz / 1e6:g} MHz", POINT if number == 0 else MUTED)
    dark = dark_variance_lsb2(found)
    if np.isfinite(dark) and "gain_lsb_per_e" in found.numbers:
        slope = found.value("gain_lsb_per_e") / found.value("contrast")
        across = np.array([0.0, most])
        line(figure, across, dark + slope * across, "by the numbers")
    figure.update_xaxes(title="amplitude, LSB", rangemode="tozero", **AXIS)
    figure.update_yaxes(title="variance of a sample, LSB²", rangemode="tozero", **AXIS)
    note = (
        "With laser light alone, variance = g / m amplitude + dark variance (EMVA 1288). Points "
        "are means of pixels with about as much light that are never saturated."
    )
    return "Photon transfer", note, styled(figure, height=340, legend=LEGEND)


def ambient_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Gray image and samples in ambient light with the laser off."""
    lit = [r for r in found.recordings if r.setting.kind == "dark" and has_electrons(r)]
    if not lit:
        return None
    words = gray_gain(found.recordings)
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.14)
    gray = np.concatenate([r.gray_mean for r in lit])
    x, y = binned(gray, np.concatenate([r.gray_variance for r in lit]))
    markers(figure, x, y, "measured", POINT, row=1, col=1)
    rest = float(np.mean(y - words * x))
    line(figure, x, words * x + rest, "by the numbers", row=1, col=1)
    electrons = np.concatenate([ambient_e(r, words) for r in lit])
    x, y = binned(electrons, np.concatenate([r.variance_lsb2.mean(0) for r in lit]))
    markers(figure, x / 1e3, y, "measured", POINT, row=1, col=2, again=True)
    dark = dark_variance_lsb2(found)
    if np.isfinite(dark):
        across = np.array([0.0, x.max()])
        gain = found.value("gain_lsb_per_e")
        line(figure, across / 1e3, dark + gain**2 * across, "", row=1, col=2, again=True)
    figure.update_xaxes(title="mean of the gray image, words", rangemode="tozero", **AXIS, col=1)
    figure.update_yaxes(title="its variance", rangemode="tozero", **AXIS, col=1)
    figure.update_xaxes(title="ambient electrons, thousands", rangemode="tozero", **AXIS, col=2)
    figure.update_yaxes(title="variance of a sample, LSB²", rangemode="tozero", **AXIS, col=2)
    note = (
        f"The gray image's own photon transfer says {words:.4g} words per electron, and so how "
        "many electrons of ambient light are in a sample; its variance grows by g² for each."
    )
    return "Ambient light", note, styled(figure, height=320, legend=LEGEND)


def full_well_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Share of saturated frames over the charge of the fuller tap."""
    well = found.numbers.get("full_well_e")
    if well is None:
        return None
    assumed, words = found.assumed, gray_gain(found.recordings)
    charges, shares = [], []
    for recording in found.recordings:
        ambient = ambient_e(recording, words)
        if recording.setting.kind == "dark" or not np.isfinite(ambient).all():
            continue
        amplitude = amplitudes_of(
            recording, found.value("harmonic_strength"), assumed.highest_harmonic
        )
        offset = recording.offset_lsb if found.offset_lsb is None else found.offset_lsb.ravel()
        gain, contrast = found.value("gain_lsb_per_e"), found.value("contrast")
        taps = taps_e(recording, offset, amplitude, ambient, gain, contrast)
        charges.append(taps.max((0, 1, 2)))
        shares.append(recording.flagged)
    charge, share = np.concatenate(charges), np.concatenate(shares)
    # Where a tap is always full, samples are cut off, and with them the charge that they tell.
    near = (np.abs(charge / well.value - 1) < 0.05) & (share < 1)
    figure = go.Figure()
    markers(figure, charge[near] / 1e3, share[near], "a pixel of a recording", POINT)
    figure.add_vrect(x0=well.low / 1e3, x1=well.high / 1e3, fillcolor=FAINT, opacity=0.25)
    figure.add_vline(x=well.value / 1e3, line={"color": ACCENT, "width": 2})
    figure.update_xaxes(title="charge of the fullest tap, thousands of electrons", **AXIS)
    figure.update_yaxes(title="share of frames saturated", range=[-0.05, 1.05], **AXIS)
    note = (
        "A tap that holds as much as the full well is full in half of the frames. The band is the "
        "interval: the gain that turns words into electrons is less certain than the edge itself."
    )
    return "Full well", note, styled(figure, height=320)


def offset_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Dark-offset map, and the distribution of its values."""
    if found.offset_lsb is None:
        return None
    figure = make_subplots(rows=1, cols=2, horizontal_spacing=0.14)
    offset = found.offset_lsb
    step = -(-offset.shape[1] // 320)  # whole pixels: the page stays small
    bar = {"title": "LSB", "len": 0.9, "x": 0.44, "thickness": 10}
    heat = go.Heatmap(z=offset[::-step, ::step].round(2), colorscale="Viridis", colorbar=bar)
    figure.add_trace(heat, row=1, col=1)
    heights, edges = np.histogram(offset, bins=40)
    middle = (edges[1:] + edges[:-1]) / 2
    figure.add_bar(x=middle, y=heights, marker={"color": FAINT}, showlegend=False, row=1, col=2)
    figure.update_xaxes(showticklabels=False, col=1)
    figure.update_yaxes(showticklabels=False, col=1)
    figure.update_xaxes(title="offset, LSB", **AXIS, col=2)
    figure.update_yaxes(title="pixels", **AXIS, col=2)
    note = "Mean of all samples in the dark. Rows that stand out make up the row's share."
    return "Dark-offset map", note, styled(figure, height=300)


def ambient_offset_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Offset that ambient light adds, in even and in odd rows."""
    added = found.numbers.get("offset_ambient_lsb")
    if added is None or found.offset_lsb is None:
        return None
    height, width = found.offset_lsb.shape
    words, well = gray_gain(found.recordings), found.value("full_well_e")
    lit = [r for r in found.recordings if r.setting.kind == "dark" and has_electrons(r)]
    share = np.concatenate([ambient_e(r, words) / (2 * well) for r in lit])
    change = np.concatenate([r.offset_lsb - found.offset_lsb.ravel() for r in lit])
    even = np.tile(np.repeat(np.arange(height) % 2 == 0, width), len(lit))
    figure = go.Figure()
    for rows, name, color, sign in ((even, "even rows", POINT, 1), (~even, "odd rows", MUTED, -1)):
        x, y = binned(share[rows], change[rows])
        markers(figure, x, y, name, color)
        across = np.array([0.0, x.max()])
        line(figure, across, sign * added.value * across, "by the number", again=sign < 0)
    figure.update_xaxes(title="ambient light, share of two full taps", rangemode="tozero", **AXIS)
    figure.update_yaxes(title="offset beyond the dark one, LSB", **AXIS)
    note = "The simulated camera adds as much in even rows as it takes in odd ones."
    return "Offset by ambient light", note, styled(figure, height=320, legend=LEGEND)


def wiggle_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Error in distance over the decoded phase, with what the stored table and overtones say."""
    walls: list[Moments] = [r for r in found.recordings if r.setting.kind == "wall"]
    if not walls:
        return None
    assumed = found.assumed
    phases = wall_phases(walls, found.stretch, assumed.frequencies_hz)
    curves = wall_curves(walls, found.stretch, assumed.frequencies_hz)
    figure = make_subplots(rows=1, cols=len(curves), horizontal_spacing=0.14)
    grid = np.linspace(0, 2 * np.pi, 361)
    for k, (decoded, true, weight) in enumerate(zip(*phases, strict=True)):
        place: dict[str, Any] = {"row": 1, "col": k + 1, "again": k > 0}
        to_mm = 1e3 / rad_per_m(assumed.frequencies_hz)[k]
        used = weight > 0
        difference = decoded[used] - true[used]
        middle = np.angle(np.exp(1j * difference).sum())
        error = np.angle(np.exp(1j * (difference - middle))) + middle
        x, y = fine_bins(np.mod(decoded[used], 2 * np.pi), error)
        markers(figure, np.degrees(x), y * to_mm, "walls", POINT, **place)
        if np.isfinite(curves[k]).all():
            stored = wiggle_columns(grid) @ curves[k] * to_mm
            line(figure, np.degrees(grid), stored, "stored table", **place)
            if "harmonic_strength" in found.numbers:
                strength = found.value("harmonic_strength")
                model = np.angle(overtone_factor(grid, strength, assumed.highest_harmonic))
                at = np.degrees(np.mod(grid + model, 2 * np.pi))
                order = np.argsort(at)
                delay = curves[k][0]
                line(
                    figure,
                    at[order],
                    (model[order] + delay) * to_mm,
                    "simulated overtones",
                    color=INK,
                    dash="dot",
                    **place,
                )
        title = f"decoded phase at {assumed.frequencies_hz[k] / 1e6:g} MHz, degrees"
        figure.update_xaxes(title=title, range=[0, 360], dtick=90, **AXIS, col=k + 1)
        figure.update_yaxes(title="measured too far, mm" if k == 0 else "", **AXIS, col=k + 1)
    note = (
        "Distance measured less the known one; the mean is the delay. The stored table follows the "
        "points; the dotted line is what the simulation makes of one strength of its overtones."
    )
    return "Wiggle", note, styled(figure, height=340, legend=LEGEND)


def fine_bins(phase_rad: Array, error: Array) -> tuple[Array, Array]:
    """Mean phase and error of every two degrees that have measurements."""
    number = (phase_rad * (180 / (2 * np.pi))).astype(int)
    count = np.bincount(number)
    some = count > 0
    means = [np.bincount(number, values)[some] / count[some] for values in (phase_rad, error)]
    return means[0], means[1]


def drift_chart(found: Calibration) -> tuple[str, str, go.Figure] | None:
    """Distance over the temperature of the imager."""
    kelvin, far_m = drift_of_distance(
        found.recordings, found.value("harmonic_strength"), found.assumed
    )
    if not len(kelvin):
        return None
    figure = go.Figure()
    markers(figure, kelvin - 273.15, far_m * 1e3, "recordings", POINT)
    drift = found.numbers.get("distance_drift_m_per_k")
    if drift is not None:
        across = np.array([kelvin.min(), kelvin.max()])
        along = far_m.mean() + drift.value * (across - kelvin.mean())
        line(figure, across - 273.15, along * 1e3, "by the number")
    figure.update_xaxes(title="imager, °C", **AXIS)
    figure.update_yaxes(title="farther than in the first, mm", **AXIS)
    note = "The same scene at several temperatures, overtones taken out, both frequencies together."
    return "Drift of distance", note, styled(figure, height=300, legend=LEGEND)


def markers(
    figure: go.Figure, x: Array, y: Array, name: str, color: str, *, again: bool = False, **place
) -> None:
    """Measured points."""
    figure.add_scatter(
        x=x,
        y=y,
        mode="markers",
        marker={"size": 6, "color": color},
        name=name,
        legendgroup=name,
        showlegend=not again,
        **place,
    )


def line(
    figure: go.Figure,
    x: Array,
    y: Array,
    name: str,
    *,
    color: str = ACCENT,
    dash: str = "solid",
    again: bool = False,
    **place,
) -> None:
    """What the numbers say."""
    figure.add_scatter(
        x=x,
        y=y,
        mode="lines",
        line={"color": color, "width": 1.8, "dash": dash},
        name=name,
        legendgroup=name,
        showlegend=not again,
        **place,
    )
