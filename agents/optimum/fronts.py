"""Depth error against laser energy: what each kind of choice reaches, from cheap to dear energy.

A front is a list of points, one for each price of energy. Energy is relative to 8 DCS in every
frame with a laser that never trips; heat is left out, so that a point tells what choosing is worth.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from agents.optimum.outcome_table import DriveTable
from unwrap.signal import Shots

ENERGY = np.array([shots / Shots.EIGHT for shots in Shots])
"""Laser energy of each action, relative to 8 DCS."""
PRICES = np.concatenate(([0.0], np.geomspace(1e-4, 4.0, 60)))
"""Prices of energy beside an error term of weight 1, from free to always-2."""


@dataclass(frozen=True)
class Front:
    """Points of a front, summed clip by clip: C clips, L points with rising energy.

    Attributes
    ----------
    energy, depth_mae_m : float64 [C, L]
        Sums over the frames of each clip.
    frames : float64 [C]
        Number of them.
    """

    energy: np.ndarray
    depth_mae_m: np.ndarray
    frames: np.ndarray

    def points(self, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean energy and error of each point, [L], with each clip counted `weight` [C] times."""
        frames = weight @ self.frames
        return weight @ self.energy / frames, weight @ self.depth_mae_m / frames

    def error_at(self, energy: float, weight: np.ndarray) -> float:
        """Mean error at a mean energy, metres; between two points they are mixed."""
        return float(np.interp(energy, *self.points(weight)))

    def energy_at(self, depth_mae_m: float, weight: np.ndarray) -> float:
        """Least mean energy at which the mean error is no more than `depth_mae_m`; 1 at most."""
        energy, error = self.points(weight)
        # Along a front the error falls but for noise; running minima make it fall for certain.
        falling = np.minimum.accumulate(error)
        if depth_mae_m < falling[-1]:
            return 1.0
        return float(np.interp(-depth_mae_m, -falling, energy))


def front_of(costs: np.ndarray, table: DriveTable, clips: np.ndarray) -> Front:
    """The front of choosing what is cheapest by `costs`, what each action is thought to err.

    Parameters
    ----------
    costs : float64 [N, T, A]
        Known, or foreseen, error term of each action.
    table : DriveTable
        What each action does bring.
    clips : int64 [N, T]
        Number of the clip that each frame is of.
    """
    # From dear to free energy, so that energy rises along the front.
    chosen = np.stack([np.argmin(costs + price * ENERGY, axis=-1) for price in PRICES[::-1]], -1)
    return _summed(ENERGY[chosen], np.take_along_axis(table.depth_mae_m, chosen, axis=-1), clips)


def blind_front(table: DriveTable, clips: np.ndarray) -> Front:
    """The front of choices that look at nothing: 2, 4 or 8 DCS drawn with fixed probabilities."""
    shape = table.depth_mae_m.shape
    whole = _summed(np.broadcast_to(ENERGY, shape), table.depth_mae_m, clips)
    _, error = whole.points(np.ones(len(whole.frames)))
    # Mixing 2 and 8 DCS may be better than 4; then 4 is no point of the front.
    mixed = np.interp(ENERGY[1], ENERGY[[0, 2]], error[[0, 2]])
    points = [0, 1, 2] if error[1] <= mixed else [0, 2]
    return Front(whole.energy[:, points], whole.depth_mae_m[:, points], whole.frames)


def by_clip(values: np.ndarray, clips: np.ndarray) -> np.ndarray:
    """Sums [C, ...] over the frames of each clip of `values` [N, T, ...]."""
    _, number = np.unique(clips, return_inverse=True)
    sums = np.zeros((number.max() + 1, *values.shape[2:]))
    np.add.at(sums, number.ravel(), values.reshape(-1, *values.shape[2:]))
    return sums


def _summed(energy: np.ndarray, depth_mae_m: np.ndarray, clips: np.ndarray) -> Front:
    frames = by_clip(np.ones(clips.shape), clips)
    return Front(by_clip(energy, clips), by_clip(depth_mae_m, clips), frames)
