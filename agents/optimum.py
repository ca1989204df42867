"""The clairvoyant optimum: what the best choice of shots costs when every outcome is known.

Sensor noise depends on the drive's seed and the frame alone, so the cost and the heat of each
action in each frame are fixed numbers, up to what a warm laser's efficiency adds to them; only
the laser's temperature and its trip couple the frames. Dynamic programming over the discretised
temperatures and the trip solves that exactly up to the grid, and the resulting choices are then
played with the undiscretised thermal model.

N drives, T frames, A = 3 actions throughout; temperatures in kelvin, heat in joules.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

Choice = Callable[["Situation"], np.ndarray]
Name = TypeVar("Name")


class Laser(NamedTuple):
    """State of each drive's laser, [N, ...] for several states of each.

    `case_k` is the temperature of the case, `rise_k` what the junction is above it.
    """

    case_k: np.ndarray
    rise_k: np.ndarray
    tripped: np.ndarray

    @property
    def temperature_k(self) -> np.ndarray:
        """Of the junction."""
        return self.case_k + self.rise_k


Advance = Callable[[Laser, np.ndarray], Laser]


class Rule(NamedTuple):
    """Parameters of a one-threshold rule: actions below and above `limit`."""

    limit: float
    below: int
    above: int


@dataclass(frozen=True)
class DriveTable:
    """Everything that drives can turn out to be.

    Attributes
    ----------
    cost : float64 [N, T, A]
        Weighted cost (minus reward) of each action while the laser works, at 25 C.
    laser_cost : float64 [N, A]
        Part of it that pays for the laser's electrical energy.
    surplus : callable
        Share by which that energy is more at a junction temperature [N, ...] than at 25 C; any
        shape that broadcasts.
    tripped_cost : float64 [N, T]
        Cost of a frame in which the laser is off because it tripped.
    heat_j : float64 [N, A]
        Heat that each action leaves in the laser, at 25 C.
    start_k : float64 [N]
        Laser temperature before the first frame.
    snr : float64 [N, T, A]
        The observed feature `signal_to_noise` after each action.
    span_k : (low, high)
        No case gets colder or hotter than this, whatever is chosen.
    highest_rise_k : float
        No junction gets hotter than this above its case; 0 without a junction stage.
    advance : callable
        The laser's thermal model over one frame: (laser, heat at 25 C) to the next laser; the two
        broadcast. With `tripped`, the heat given is zero.
    """

    cost: np.ndarray
    laser_cost: np.ndarray
    surplus: Callable[[np.ndarray], np.ndarray]
    tripped_cost: np.ndarray
    heat_j: np.ndarray
    start_k: np.ndarray
    snr: np.ndarray
    span_k: tuple[float, float]
    highest_rise_k: float
    advance: Advance

    def cost_at(self, frame: int, temperature_k: np.ndarray) -> np.ndarray:
        """Cost of each action at junction temperatures [N, ...]: [N, ..., A]."""
        surplus = np.expand_dims(self.surplus(temperature_k), -1)
        cost, laser_cost = (
            _beside(values, temperature_k) for values in (self.cost[:, frame], self.laser_cost)
        )
        return cost + laser_cost * surplus

    def start(self) -> Laser:
        """The lasers before the first frame."""
        none = np.zeros(len(self.start_k))
        return Laser(self.start_k.copy(), none, none.astype(bool))


@dataclass(frozen=True)
class Situation:
    """What a choice may depend on; a policy that is not clairvoyant looks at `snr` at most.

    Attributes
    ----------
    frame : int
        Number of the frame.
    laser : Laser
        Of each drive, [N].
    snr : [N]
        Feature `signal_to_noise` of the last acquisition, 0 before the first.
    table : DriveTable
        What each action would bring.
    """

    frame: int
    laser: Laser
    snr: np.ndarray
    table: DriveTable

    @property
    def cost(self) -> np.ndarray:
        """Cost of each action in this frame, [N, A]."""
        return self.table.cost_at(self.frame, self.laser.temperature_k)


@dataclass(frozen=True)
class Played:
    """Drives as they were played.

    Attributes
    ----------
    actions : int64 [N, T]
        Chosen actions, -1 in frames in which the laser was off.
    cost : float64 [N]
        Summed cost of each drive.
    """

    actions: np.ndarray
    cost: np.ndarray

    @property
    def shares(self) -> np.ndarray:
        """Share of each action among the frames with laser, [A]."""
        chosen = self.actions[self.actions >= 0]
        return np.bincount(chosen, minlength=3) / max(chosen.size, 1)

    @property
    def tripped_share(self) -> float:
        """Share of frames in which the laser was off."""
        return float(np.mean(self.actions < 0))


def play(table: DriveTable, choose: Choice) -> Played:
    """Play every drive of `table`, asking `choose` for the actions [N] of each frame."""
    drives, frames, _ = table.cost.shape
    laser, snr, cost = table.start(), np.zeros(drives), np.zeros(drives)
    rows, actions = np.arange(drives), np.empty((drives, frames), np.int64)
    for frame in range(frames):
        now = Situation(frame, laser, snr, table)
        chosen = choose(now)
        actions[:, frame] = np.where(laser.tripped, -1, chosen)
        cost += np.where(laser.tripped, table.tripped_cost[:, frame], now.cost[rows, chosen])
        snr = np.where(laser.tripped, snr, table.snr[rows, frame, chosen])
        heat_j = np.where(laser.tripped, 0.0, table.heat_j[rows, chosen])
        laser = table.advance(laser, heat_j)
    return Played(actions, cost)


def clairvoyant(table: DriveTable, *, levels: int = 801, rise_levels: int = 25) -> Played:
    """Optimum over all choices, by dynamic programming on a grid of temperatures.

    `levels` temperatures of the case; with a junction stage a quarter of them, times `rise_levels`
    rises of the junction.
    """
    grid = _grid(table, levels, rise_levels)
    values = _values_to_go(table, grid)

    def choose(now: Situation) -> np.ndarray:
        """Action of least cost now plus least cost from then on."""
        to_go = _look_up(values[now.frame + 1], _corners(grid, _consequences(table, now.laser)))
        return np.argmin(now.cost + to_go, axis=-1)

    return play(table, choose)


def greedy(table: DriveTable, *, guarded: bool) -> Played:
    """Least cost of this frame alone; `guarded` avoids actions that trip the laser at once."""

    def choose(now: Situation) -> np.ndarray:
        trips = _consequences(table, now.laser).tripped
        barred = trips & ~trips.all(axis=-1, keepdims=True) & guarded
        return np.argmin(np.where(barred, np.inf, now.cost), axis=-1)

    return play(table, choose)


def fixed(action: int) -> Choice:
    """Choose `action` in every frame."""
    return lambda now: np.full(now.snr.shape, action)


def cycle(pattern: tuple[int, ...]) -> Choice:
    """Repeat a pattern of actions, frame after frame."""
    return lambda now: np.full(now.snr.shape, pattern[now.frame % len(pattern)])


def mixture(shares: tuple[float, float, float], *, seed: int = 0) -> Choice:
    """Draw each action with a fixed probability, independently of everything."""
    edges = np.cumsum(shares)[:-1]

    def choose(now: Situation) -> np.ndarray:
        draw = np.random.default_rng((seed, now.frame)).random(now.snr.shape)
        return np.searchsorted(edges, draw, side="right")

    return choose


def threshold(limit: float, below: int, above: int) -> Choice:
    """One action where the last signal-to-noise is below `limit`, another from there on."""
    return lambda now: np.where(now.snr < limit, below, above)


def threshold_choices(table: DriveTable, limits: int = 40) -> Iterator[tuple[Rule, Choice]]:
    """Every pair of actions in either order, with thresholds at quantiles of the feature."""
    quantiles = np.quantile(table.snr, np.linspace(0.01, 0.99, limits))
    for limit, (below, above) in itertools.product(
        np.unique(quantiles).tolist(), itertools.permutations(range(3), 2)
    ):
        yield Rule(limit, below, above), threshold(limit, below, above)


def best_choice(table: DriveTable, choices: Iterable[tuple[Name, Choice]]) -> Name:
    """Name of the choice that costs least over all drives of `table`."""
    return min(choices, key=lambda choice: play(table, choice[1]).cost.sum())[0]


def blind_choices(longest: int = 8, steps: int = 5) -> Iterator[tuple[str, Choice]]:
    """Choices that look at nothing: fixed, one frame in n different, and mixtures on a grid."""
    for action in range(3):
        yield f"always {_SHOTS[action]}", fixed(action)
    for length, (one, rest) in itertools.product(
        range(2, longest + 1), itertools.permutations(range(3), 2)
    ):
        name = f"{_SHOTS[one]} every {length} frames, else {_SHOTS[rest]}"
        yield name, cycle((one, *[rest] * (length - 1)))
    for two, four in itertools.product(range(1, steps), repeat=2):
        if two + four < steps:
            shares = (two / steps, four / steps, 1 - (two + four) / steps)
            yield "mixture {:.0%}/{:.0%}/{:.0%} of 2/4/8".format(*shares), mixture(shares)


_SHOTS = (2, 4, 8)


class _Grid(NamedTuple):
    """Evenly spaced temperatures of the case, and rises of the junction above it."""

    case_k: np.ndarray
    rise_k: np.ndarray

    def everywhere(self, drives: int, *, tripped: bool) -> Laser:
        """A laser at every point of the grid, [N, K]."""
        case_k, rise_k = np.meshgrid(self.case_k, self.rise_k, indexing="ij")
        shape = drives, case_k.size
        return Laser(
            np.broadcast_to(case_k.ravel(), shape),
            np.broadcast_to(rise_k.ravel(), shape),
            np.full(shape, tripped),
        )


def _grid(table: DriveTable, levels: int, rise_levels: int) -> _Grid:
    if not table.highest_rise_k:
        return _Grid(np.linspace(*table.span_k, levels), np.zeros(1))
    rises_k = np.linspace(0.0, table.highest_rise_k, rise_levels)
    return _Grid(np.linspace(*table.span_k, levels // 4), rises_k)


def _values_to_go(table: DriveTable, grid: _Grid) -> np.ndarray:
    """Least cost from each frame on, [T + 1, 2 (tripped), N, case levels, rise levels]."""
    drives, frames, _ = table.cost.shape
    shape = drives, grid.case_k.size, grid.rise_k.size
    values = np.zeros((frames + 1, 2, *shape))
    on, off = (grid.everywhere(drives, tripped=tripped) for tripped in (False, True))
    warmed = _corners(grid, _consequences(table, on))
    cooled = _corners(grid, table.advance(off, np.zeros(off.case_k.shape)))
    for frame in reversed(range(frames)):
        cost, to_go = table.cost_at(frame, on.temperature_k), values[frame + 1]
        working = np.min(cost + _look_up(to_go, warmed), axis=-1)
        tripped = table.tripped_cost[:, frame, None] + _look_up(to_go, cooled)
        values[frame] = working.reshape(shape), tripped.reshape(shape)
    return values


def _consequences(table: DriveTable, laser: Laser) -> Laser:
    """The lasers [N, ...] one frame later, after each action: [N, ..., A]."""
    heat_j = _beside(table.heat_j, laser.case_k)
    before = Laser(*(np.expand_dims(value, -1) for value in laser))
    return table.advance(before, np.where(before.tripped, 0.0, heat_j))


def _beside(values: np.ndarray, states: np.ndarray) -> np.ndarray:
    """Values [N, A] of each drive for states [N, ...] of it: [N, ..., A], broadcast."""
    return values.reshape(len(values), *[1] * (states.ndim - 1), -1)


class _Corners(NamedTuple):
    """Points of the grid around some lasers [N, ...]: where they are stored, and their weights.

    Both are [2 or 4, N, ...].
    """

    stored: np.ndarray
    weight: np.ndarray


def _corners(grid: _Grid, laser: Laser) -> _Corners:
    """The grid points that a value is interpolated from."""
    case_k, rise_k, tripped = np.broadcast_arrays(*laser)
    drive = np.arange(len(case_k)).reshape(-1, *[1] * (case_k.ndim - 1))
    row = (tripped * len(case_k) + drive) * grid.case_k.size
    stored, weight = zip(
        *(
            ((row + case) * grid.rise_k.size + rise, near * close)
            for case, near in _ends(grid.case_k, case_k)
            for rise, close in _ends(grid.rise_k, rise_k)
        ),
        strict=True,
    )
    return _Corners(np.stack(stored), np.stack(weight))


def _look_up(values: np.ndarray, corners: _Corners) -> np.ndarray:
    """Interpolate values [2, N, case levels, rise levels] of the grid."""
    return (values.reshape(-1).take(corners.stored) * corners.weight).sum(axis=0)


def _ends(axis: np.ndarray, value: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Grid levels around each value: their index and weight."""
    if axis.size == 1:
        return [(np.zeros(value.shape, np.int64), np.ones(value.shape))]
    position = np.clip((value - axis[0]) / (axis[1] - axis[0]), 0.0, axis.size - 1.0)
    below = np.minimum(position.astype(np.int64), axis.size - 2)
    share = position - below
    return [(below, 1.0 - share), (below + 1, share)]
