"""Depth error against laser energy: what each kind of choice reaches, from cheap to dear energy.

A front is a set of points, such as one for each price of energy. Energy is relative to 8 DCS in
every frame with a laser that never trips. `front_of` and `blind_front` leave heat out, so that a
point tells what choosing is worth.
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
    """Points of a front, summed clip by clip: C clips, L points in any order.

    Two points may be mixed over time, some drives as the one and the others as the other: what a
    front reaches is the lower convex hull of its points.

    Attributes
    ----------
    energy, depth_mae_m : float64 [C, L]
        Sums over the frames of each clip.
    frames : float64 [C]
        Number of them.

    Examples
    --------
    >>> front = Front(np.array([[0.25, 1.0]]), np.array([[1.25, 0.5]]), np.ones(1))
    >>> once = np.ones(1)
    >>> float(front.error_at(0.625, once)), front.energy_at(0.875, once)
    (0.875, 0.625)
    """

    energy: np.ndarray
    depth_mae_m: np.ndarray
    frames: np.ndarray

    def means(self, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean energy and error of each point, [L], with each clip counted `weight` [C] times."""
        frames = weight @ self.frames
        return weight @ self.energy / frames, weight @ self.depth_mae_m / frames

    def points(self, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same with energy rising."""
        energy, error = self.means(weight)
        rising = np.argsort(energy, kind="stable")
        return energy[rising], error[rising]

    def corners(self, weight: np.ndarray) -> np.ndarray:
        """Numbers of the points that no mixture of others is as good as, energy rising; int64 [H].

        The corners of the lower convex hull, from the least energy to the least error (Andrew's
        monotone chain, Inf. Process. Lett. 9, 1979).
        """
        means = self.means(weight)
        energy, error = (values.tolist() for values in means)  # plain numbers are faster one by one
        corners: list[int] = []
        # Of points with the same energy the best comes first; those after it are no corners.
        for point in np.lexsort(means[::-1]).tolist():
            while len(corners) > 1:
                (x0, y0), (x1, y1) = ((energy[i], error[i]) for i in corners[-2:])
                # A corner stays that lies below the line from the one before it to this point.
                if (y1 - y0) * (energy[point] - x0) < (error[point] - y0) * (x1 - x0):
                    break
                corners.pop()
            corners.append(point)
        # Beyond the least error more energy buys nothing.
        least = min(range(len(corners)), key=lambda i: error[corners[i]])
        return np.array(corners[: least + 1])

    def error_at(self, energy: float | np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Least mean error at mean energies, metres; infinite below the least energy."""
        corners = self.corners(weight)
        corner_energy, error = (values[corners] for values in self.means(weight))
        return np.interp(np.asarray(energy), corner_energy, error, left=np.inf)

    def reaches(self, depth_mae_m: float, weight: np.ndarray) -> bool:
        """Whether any point errs no more than `depth_mae_m`."""
        return bool(self.means(weight)[1].min() <= depth_mae_m)

    def energy_at(self, depth_mae_m: float, weight: np.ndarray) -> float:
        """Least mean energy at which the mean error is no more than `depth_mae_m`.

        1, all that there is, where no mixture errs so little.
        """
        if not self.reaches(depth_mae_m, weight):
            return 1.0
        return float(self.mixture_at(depth_mae_m, weight) @ self.means(weight)[0])

    def mixture_at(self, depth_mae_m: float, weight: np.ndarray) -> np.ndarray:
        """Share of time of each point, [L], where least energy makes the error `depth_mae_m`.

        Of the ends alone beyond them. What else a point tells mixes with the same shares.
        """
        corners = self.corners(weight)
        error = self.means(weight)[1][corners]
        # `interp` wants rising numbers, and errors fall along the corners.
        return self._mixed(corners, np.interp(-depth_mae_m, -error, np.arange(len(corners))))

    def mixture_spending(self, energy: float, weight: np.ndarray) -> np.ndarray:
        """Share of time of each point, [L], where the mean energy `energy` makes the least error.

        Of the ends alone beyond them.
        """
        corners = self.corners(weight)
        spent = self.means(weight)[0][corners]
        return self._mixed(corners, np.interp(energy, spent, np.arange(len(corners))))

    def _mixed(self, corners: np.ndarray, place: float) -> np.ndarray:
        """Shares [L] at a place between two corners, 1.5 in the middle of the second and third."""
        before = min(int(place), len(corners) - 1)
        after = min(before + 1, len(corners) - 1)
        shares = np.zeros(self.energy.shape[1])
        shares[corners[before]] += 1.0 - (place - before)
        shares[corners[after]] += place - before
        return shares

    def hypervolume(self, reference_m: float, weight: np.ndarray) -> float:
        """Area that the points dominate, up to an energy of 1 and an error of `reference_m`, m.

        Of the points alone, without mixtures (Zitzler and Thiele, IEEE Trans. Evol. Comput. 3,
        1999).
        """
        energy, error = self.points(weight)
        least = np.minimum.accumulate(error)
        width = np.diff(np.minimum(energy, 1.0), append=1.0)
        return float(width @ np.maximum(reference_m - least, 0.0))


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
    # Mixing 2 and 8 DCS may be better than 4; then 4 is no corner of the front.
    return _summed(np.broadcast_to(ENERGY, shape), table.depth_mae_m, clips)


def by_clip(values: np.ndarray, clips: np.ndarray) -> np.ndarray:
    """Sums [C, ...] over the frames of each clip of `values` [N, T, ...]."""
    _, number = np.unique(clips, return_inverse=True)
    sums = np.zeros((number.max() + 1, *values.shape[2:]))
    np.add.at(sums, number.ravel(), values.reshape(-1, *values.shape[2:]))
    return sums


def _summed(energy: np.ndarray, depth_mae_m: np.ndarray, clips: np.ndarray) -> Front:
    frames = by_clip(np.ones(clips.shape), clips)
    return Front(by_clip(energy, clips), by_clip(depth_mae_m, clips), frames)
