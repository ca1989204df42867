"""The clairvoyant optimum: what the best choice of shots costs when every outcome is known.

Sensor noise depends on the drive's seed and the frame alone, so the cost and the heat of each
action in each frame are fixed numbers, up to what a warm laser's efficiency adds to them; only
the laser's temperature and its trip couple the frames. Dynamic programming over the discretised
temperatures and the trip solves that exactly up to the grid, and the resulting choices are then
played with the undiscretised thermal model.

N drives, T frames, A = 3 actions throughout; temperatures in kelvin, heat in joules.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agents.optimum.outcome_table import (
    DriveTable,
    PlayedTable,
    Situation,
    ThermalState,
    play,
)


def clairvoyant(table: DriveTable, *, levels: int = 801, rise_levels: int = 25) -> PlayedTable:
    """Optimum over all choices, by dynamic programming on a grid of temperatures.

    `levels` temperatures of the case; with a junction stage a quarter of them, times `rise_levels`
    rises of the junction.
    """
    # 801 levels over some 35 K lie 0.04 K apart; 2, 4 and 8 DCS warm the shipped laser by at most
    # 0, 0.2 and 0.6 K more a frame near its trip. A coarser grid would blur which of them trips.
    # Without a junction stage there is one rise, 0, and the case has all the levels to itself.
    stages = bool(table.highest_rise_k)
    grid = _Grid(
        np.linspace(*table.span_k, levels // 4 if stages else levels),
        np.linspace(0.0, table.highest_rise_k, rise_levels) if stages else np.zeros(1),
    )
    values = _values_to_go(table, grid)

    def choose(now: Situation) -> np.ndarray:
        """Action of least cost now plus least cost from then on."""
        # Bellman's equation at the laser's true temperature: the grid enters by `to_go` alone.
        after = table.consequences(now.laser)
        to_go = _look_up(values[now.frame + 1], _corners(grid, after))
        barred = table.barred(now.laser, after)
        return np.argmin(np.where(barred, np.inf, now.cost + to_go), axis=-1)

    return play(table, choose)


def greedy(table: DriveTable, *, guarded: bool) -> PlayedTable:
    """Least cost of this frame alone; `guarded` avoids actions that trip the laser at once."""

    def choose(now: Situation) -> np.ndarray:
        trips = table.consequences(now.laser).tripped
        # Where every action trips none is barred: one has to be taken.
        barred = trips & ~trips.all(axis=-1, keepdims=True) & guarded
        return np.argmin(np.where(barred, np.inf, now.cost), axis=-1)

    return play(table, choose)


class _Grid(NamedTuple):
    """Evenly spaced temperatures of the case, and rises of the junction above it."""

    case_k: np.ndarray
    rise_k: np.ndarray

    def everywhere(self, drives: int, *, tripped: bool) -> ThermalState:
        """A laser at every point of the grid, [N, K]."""
        case_k, rise_k = np.meshgrid(self.case_k, self.rise_k, indexing="ij")
        shape = drives, case_k.size
        return ThermalState(
            np.broadcast_to(case_k.ravel(), shape),
            np.broadcast_to(rise_k.ravel(), shape),
            np.full(shape, tripped),
        )


def _values_to_go(table: DriveTable, grid: _Grid) -> np.ndarray:
    """Least cost from each frame on, [T + 1, 2 (tripped), N, case levels, rise levels].

    Backward induction: nothing is left to pay after the last frame.
    """
    drives, frames, _ = table.cost.shape
    shape = drives, grid.case_k.size, grid.rise_k.size
    values = np.zeros((frames + 1, 2, *shape))
    on, off = (grid.everywhere(drives, tripped=tripped) for tripped in (False, True))
    # Where a grid point ends up one frame later does not depend on the frame: found once.
    after = table.consequences(on)
    # What is not granted is the same as asking for less: it need not be looked at.
    warmed, barred = _corners(grid, after), table.barred(on, after)
    none_granted = barred.all(axis=-1)
    resting = _corners(grid, table.advance(on, np.zeros(on.case_k.shape)))
    cooled = _corners(grid, table.advance(off, np.zeros(off.case_k.shape)))
    for frame in reversed(range(frames)):
        cost, to_go = table.cost_at(frame, on.temperature_k), values[frame + 1]
        working = np.min(np.where(barred, np.inf, cost + _look_up(to_go, warmed)), axis=-1)
        if none_granted.any():
            dark = table.dark_cost[:, frame, None] + _look_up(to_go, resting)
            working = np.where(none_granted, dark, working)
        tripped = table.tripped_cost[:, frame, None] + _look_up(to_go, cooled)
        values[frame] = working.reshape(shape), tripped.reshape(shape)
    return values


class _Corners(NamedTuple):
    """Points of the grid that surround the temperatures of lasers [N, ...], for interpolation.

    Attributes
    ----------
    position : int64 [2 or 4, N, ...]
        Into the flattened values of a frame, [2 (tripped), N, case levels, rise levels]; 2 points
        without a junction stage, 4 with one.
    weight : float64 [2 or 4, N, ...]
        Sum to 1 over the points.
    """

    position: np.ndarray
    weight: np.ndarray


def _corners(grid: _Grid, laser: ThermalState) -> _Corners:
    """Bilinear interpolation in the temperatures; on and tripped lasers are never mixed."""
    case_k, rise_k, tripped = np.broadcast_arrays(*laser)
    drive = np.arange(len(case_k)).reshape(-1, *[1] * (case_k.ndim - 1))
    row = (tripped * len(case_k) + drive) * grid.case_k.size
    position, weight = zip(
        *(
            ((row + case) * grid.rise_k.size + rise, case_weight * rise_weight)
            for case, case_weight in _neighbours(grid.case_k, case_k)
            for rise, rise_weight in _neighbours(grid.rise_k, rise_k)
        ),
        strict=True,
    )
    return _Corners(np.stack(position), np.stack(weight))


def _look_up(values: np.ndarray, corners: _Corners) -> np.ndarray:
    """Interpolate values [2, N, case levels, rise levels] of the grid."""
    return (values.reshape(-1).take(corners.position) * corners.weight).sum(axis=0)


def _neighbours(axis: np.ndarray, value: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The levels below and above each value: their index and weight; one where there is but one."""
    if axis.size == 1:
        return [(np.zeros(value.shape, np.int64), np.ones(value.shape))]
    position = np.clip((value - axis[0]) / (axis[1] - axis[0]), 0.0, axis.size - 1.0)
    # A value on the last level lies between the last two, with all the weight on the upper.
    below = np.minimum(position.astype(np.int64), axis.size - 2)
    share = position - below
    return [(below, 1.0 - share), (below + 1, share)]
