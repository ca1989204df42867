"""Drives as tables, what each action brings in each frame, and choices played on them.

N drives, T frames, A = 3 actions throughout; temperatures in kelvin, heat in joules.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from unwrap.signal import Shots

# A policy on a table. Not `Policy`, which sees observations alone: the clairvoyant sees the costs.
Choice = Callable[["Situation"], np.ndarray]
"""From what is known before a frame to the action of each drive, int64 [N]."""


class ThermalState(NamedTuple):
    """Of each drive's laser, [N, ...] for several states of each.

    `case_k` is the temperature of the case, `rise_k` what the junction is above it.
    """

    case_k: np.ndarray
    rise_k: np.ndarray
    tripped: np.ndarray

    @property
    def temperature_k(self) -> np.ndarray:
        """Of the junction."""
        return self.case_k + self.rise_k


Advance = Callable[[ThermalState, np.ndarray], ThermalState]


@dataclass(frozen=True)
class DriveTable:
    """What each action would cost, heat and tell in every frame of N drives.

    A row of `cost` such as (0.31, 0.24, 0.29) says that in this frame 4 DCS are best. Its numbers
    do not depend on the actions before: the noise is that of the frame, and what a warm laser adds
    is left to `surplus`.

    Attributes
    ----------
    cost : float64 [N, T, A]
        Weighted cost (minus reward) of each action while the laser works, at 25 C.
    reference : float64 [N, T]
        Cost of 4 DCS in each frame with a laser that heat does not hold back: what returns are
        relative to.
    error : float64 [N, T, A]
        Part of the cost that pays for the depth error.
    depth_mae_m : float64 [N, T, A]
    laser_cost : float64 [N, A]
        Part of it that pays for the laser's electrical energy.
    surplus : callable
        Share by which that energy is more at a junction temperature [N, ...] than at 25 C; any
        shape that broadcasts.
    dark_cost, tripped_cost : float64 [N, T]
        Cost of a frame in which the laser is off because even the fewest samples would trip it,
        and because it tripped.
    heat_j : float64 [N, A]
        Heat that each action leaves in the laser, at 25 C.
    start_k : float64 [N]
        Temperature of case and junction before the first frame.
    snr : float64 [N, T, A]
        The observed feature `signal_to_noise` after each action.
    span_k : (low, high)
        No case gets colder or hotter than this, whatever is chosen.
    highest_rise_k : float
        No junction gets hotter than this above its case; 0 without a junction stage.
    advance : callable
        The laser's thermal model over one frame: (laser, heat at 25 C) to the next laser; the two
        broadcast. With `tripped`, the heat given is zero.
    scale : float
        Factor of returns.
    protect : bool
        Whether fewer shots are granted where those asked for would trip the laser.
    """

    cost: np.ndarray
    reference: np.ndarray
    error: np.ndarray
    depth_mae_m: np.ndarray
    laser_cost: np.ndarray
    surplus: Callable[[np.ndarray], np.ndarray]
    dark_cost: np.ndarray
    tripped_cost: np.ndarray
    heat_j: np.ndarray
    start_k: np.ndarray
    snr: np.ndarray
    span_k: tuple[float, float]
    highest_rise_k: float
    advance: Advance
    scale: float
    protect: bool

    def returns(self, frame_cost: np.ndarray) -> np.ndarray:
        """Returns [N] of drives that cost `frame_cost` [N, T]: what they cost less than 4 DCS."""
        return self.scale * (self.reference - frame_cost).sum(axis=1)

    def cost_at(self, frame: int, temperature_k: np.ndarray) -> np.ndarray:
        """Cost of each action at junction temperatures [N, ...]: [N, ..., A].

        One temperature a drive when it is played, all temperatures of the grid for the optimum.
        """
        surplus = np.expand_dims(self.surplus(temperature_k), -1)
        cost, laser_cost = (
            _for_each_state(values, temperature_k)
            for values in (self.cost[:, frame], self.laser_cost)
        )
        return cost + laser_cost * surplus

    def consequences(self, laser: ThermalState) -> ThermalState:
        """The lasers [N, ...] one frame later, after each action: [N, ..., A]."""
        heat_j = _for_each_state(self.heat_j, laser.case_k)
        before = ThermalState(*(np.expand_dims(value, -1) for value in laser))
        return self.advance(before, np.where(before.tripped, 0.0, heat_j))

    def barred(self, laser: ThermalState, after: ThermalState) -> np.ndarray:
        """Actions [N, ..., A] that are not granted: they would trip a laser that protects itself.

        `after` are the lasers' `consequences`.
        """
        return after.tripped & ~np.expand_dims(laser.tripped, -1) & self.protect

    def granted(self, laser: ThermalState, actions: np.ndarray) -> np.ndarray:
        """Actions [N] taken of those asked for: the next lower not barred, -1 where all are."""
        barred = self.barred(laser, self.consequences(laser))
        rows = np.arange(len(actions))
        for _ in range(barred.shape[-1]):
            actions = actions - ((actions >= 0) & barred[rows, actions])
        return actions

    def start(self) -> ThermalState:
        """The lasers before the first frame."""
        # Long off: the junction is as cold as the case. A copy, since tables are not to change.
        none = np.zeros(len(self.start_k))
        return ThermalState(self.start_k.copy(), none, none.astype(bool))


@dataclass(frozen=True)
class Situation:
    """What a choice may depend on; a policy that is not clairvoyant looks at `snr` at most.

    Attributes
    ----------
    frame : int
        Number of the frame.
    laser : ThermalState
        Of each drive, [N].
    snr : [N]
        Feature `signal_to_noise` of the last acquisition, 0 before the first.
    table : DriveTable
        What each action would bring.
    """

    frame: int
    laser: ThermalState
    snr: np.ndarray
    table: DriveTable

    @property
    def cost(self) -> np.ndarray:
        """Cost of each action in this frame, [N, A]."""
        return self.table.cost_at(self.frame, self.laser.temperature_k)


@dataclass(frozen=True)
class PlayedTable:
    """Drives of a table as they were played.

    Attributes
    ----------
    actions : int64 [N, T]
        Actions taken, -1 in frames in which the laser was off.
    frame_cost : float64 [N, T]
    """

    actions: np.ndarray
    frame_cost: np.ndarray

    @property
    def cost(self) -> np.ndarray:
        """Summed cost of each drive, [N]."""
        return self.frame_cost.sum(axis=1)

    @property
    def shares(self) -> np.ndarray:
        """Share of each action among the frames with laser, [A]."""
        chosen = self.actions[self.actions >= 0]
        # Without any such frame all shares are 0, not undefined.
        return np.bincount(chosen, minlength=3) / max(chosen.size, 1)

    @property
    def energy_share(self) -> float:
        """Laser energy relative to 8 DCS in every frame with a laser that never trips."""
        samples = np.array([*Shots, 0])  # The last is that of -1, a laser that is off.
        return float(samples[self.actions].mean() / Shots.EIGHT)

    @property
    def tripped_share(self) -> float:
        """Share of frames in which the laser was off."""
        return float(np.mean(self.actions < 0))


def play(table: DriveTable, choose: Choice) -> PlayedTable:
    """Play every drive of `table`, asking `choose` for the actions [N] of each frame."""
    drives, frames, _ = table.cost.shape
    laser, snr, rows = table.start(), np.zeros(drives), np.arange(drives)
    actions, frame_cost = np.empty((drives, frames), np.int64), np.empty((drives, frames))
    for frame in range(frames):
        now = Situation(frame, laser, snr, table)
        # Without laser no samples are taken: nothing is told, nothing warms, the action is void.
        taken = np.where(laser.tripped, -1, table.granted(laser, choose(now)))
        off, actions[:, frame] = taken < 0, taken
        off_cost = np.where(laser.tripped, table.tripped_cost[:, frame], table.dark_cost[:, frame])
        frame_cost[:, frame] = np.where(off, off_cost, now.cost[rows, taken])
        snr = np.where(off, snr, table.snr[rows, frame, taken])
        heat_j = np.where(off, 0.0, table.heat_j[rows, taken])
        laser = table.advance(laser, heat_j)
    return PlayedTable(actions, frame_cost)


def _for_each_state(values: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Values [N, A] of N drives as [N, 1, ..., A], to broadcast with states [N, ...] of them."""
    return values.reshape(len(values), *[1] * (states.ndim - 1), -1)
