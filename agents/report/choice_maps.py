"""What a policy asks for, over pairs of what it observed: counts of its choices in cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from agents.evaluation import PlayedDrives
from agents.policies import SNR_FEATURE
from shotenv.decision import FEATURE_NAMES, feature_index, heat_margin_k
from unwrap.signal import Shots

MARGINS_K = (0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0, np.inf)
"""Between cells of the margin: finer near the trip, where a frame's heat matters."""
DISTANCE_STEP_M, SNR_STEP = 2.0, 0.1


class Axis(NamedTuple):
    """One side of a map.

    Attributes
    ----------
    title, unit : str
    edges : float64 [K + 1]
        Between its K cells; a value on an edge belongs to the cell above, one beyond them to the
        nearest.
    value : callable
        Of each frame [N, T] of played drives.
    marks : tuple of K floats or None
        What stands for each cell, where values are those numbers alone; None: it is told by edges.
    """

    title: str
    unit: str
    edges: np.ndarray
    value: Callable[[PlayedDrives], np.ndarray]
    marks: tuple[float, ...] | None = None


def choice_maps(played: Sequence[PlayedDrives], range_m: float) -> list[dict[str, Any]]:
    """Maps of the same drives as they were played at one price or several.

    Frames in which the laser was off are left out, as there was nothing to choose; so is the
    first of each drive, before which nothing was measured.

    Parameters
    ----------
    played : sequence of PlayedDrives
        At rising prices of power, each the same in all drives.
    range_m : float
        Largest scored range, which distances are observed relative to, metres.

    Returns
    -------
    list of dict
        Of each map "x" and "y", an axis each ("title", "unit", and "edges" between the cells or
        "marks" of the cells), and "counts" [y][x] of the frames in which 2, 4 and 8 DCS were asked
        for. Rows and columns at the border without a frame are cut off.
    """
    prices = tuple(float(one.power_price[0]) for one in played)
    signal = Axis(
        "signal-to-noise",
        "",
        # Rounded, since steps of a tenth do not add up to plain numbers.
        np.round(np.arange(0.0, 1.0 + SNR_STEP / 2, SNR_STEP), 2),
        lambda one: _observed(one, SNR_FEATURE),
    )
    distance = Axis(
        "mean predicted distance",
        "m",
        np.arange(0.0, 2.0 * range_m + DISTANCE_STEP_M, DISTANCE_STEP_M),
        lambda one: range_m * _observed(one, "network_distance"),
    )
    margin = Axis(
        "below the laser's trip",
        "K",
        np.array(MARGINS_K),
        lambda one: heat_margin_k(_observed(one, "heat_margin")),
    )
    price = Axis(
        "price of power",
        "",
        _around(prices),
        lambda one: np.broadcast_to(one.power_price[:, None], one.shots.shape),
        prices,
    )
    return [_map(played, signal, distance), _map(played, margin, price)]


def _observed(played: PlayedDrives, name: str) -> np.ndarray:
    return played.observations[..., feature_index(FEATURE_NAMES, name)].astype(np.float64)


def _around(marks: Sequence[float]) -> np.ndarray:
    """Edges with one of the rising `marks` between two each."""
    between = (np.array(marks[1:]) + np.array(marks[:-1])) / 2.0
    return np.concatenate(([-np.inf], between, [np.inf]))


def _map(played: Sequence[PlayedDrives], x: Axis, y: Axis) -> dict[str, Any]:
    chosen = np.concatenate([_of_interest(one, one.asked) for one in played])
    columns, rows = (_cells(played, axis) for axis in (x, y))
    counts = np.zeros((len(y.edges) - 1, len(x.edges) - 1, len(Shots)), np.int64)
    np.add.at(counts, (rows, columns, np.searchsorted(list(Shots), chosen)), 1)
    across, along = (_occupied(counts.sum(axis=(2, other))) for other in (0, 1))
    return {
        "x": _told(x, across),
        "y": _told(y, along),
        "counts": counts[along, across].tolist(),
    }


def _cells(played: Sequence[PlayedDrives], axis: Axis) -> np.ndarray:
    """Number of the cell of each frame that counts."""
    values = np.concatenate([_of_interest(one, axis.value(one)) for one in played])
    return np.clip(np.digitize(values, axis.edges) - 1, 0, len(axis.edges) - 2)


def _of_interest(played: PlayedDrives, values: np.ndarray) -> np.ndarray:
    """Those of the frames [N, T] that a map counts."""
    return values[:, 1:][played.shots[:, 1:] > 0]


def _occupied(frames: np.ndarray) -> slice:
    """From the first to the last cell that has frames; all cells where none has."""
    there = np.flatnonzero(frames)
    return slice(int(there[0]), int(there[-1]) + 1) if len(there) else slice(0, len(frames))


def _told(axis: Axis, cells: slice) -> dict[str, Any]:
    if axis.marks is not None:
        return {"title": axis.title, "unit": axis.unit, "marks": list(axis.marks[cells])}
    edges = axis.edges[cells.start : cells.stop + 1].tolist()
    # JSON knows no infinity.
    told = [edge if np.isfinite(edge) else None for edge in edges]
    return {"title": axis.title, "unit": axis.unit, "edges": told}
