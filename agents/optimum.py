"""The clairvoyant optimum: what the best choice of shots costs when every outcome is known.

Sensor noise depends on the drive's seed and the frame alone, so the cost and the heat of each
action in each frame are fixed numbers; only the laser's temperature and its trip couple the
frames. Dynamic programming over the discretised temperature and the trip solves that exactly up
to the grid, and the resulting choices are then played with the undiscretised thermal model.

N drives, T frames, A = 3 actions throughout; temperatures in kelvin, heat in joules.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np

Advance = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
Choice = Callable[["Situation"], np.ndarray]
Name = TypeVar("Name")


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
        Weighted cost (minus reward) of each action while the laser works.
    tripped_cost : float64 [N, T]
        Cost of a frame in which the laser is off because it tripped.
    heat_j : float64 [N, T, A]
        Heat that each action leaves in the laser.
    start_k : float64 [N]
        Laser temperature before the first frame.
    snr : float64 [N, T, A]
        The observed feature `signal_to_noise` after each action.
    span_k : (low, high)
        No laser gets colder or hotter than this, whatever is chosen.
    advance : callable
        The laser's thermal model over one frame: (temperature_k, tripped, heat_j), each [N, ...],
        to the next (temperature_k, tripped). With `tripped`, the heat given is zero.
    """

    cost: np.ndarray
    tripped_cost: np.ndarray
    heat_j: np.ndarray
    start_k: np.ndarray
    snr: np.ndarray
    span_k: tuple[float, float]
    advance: Advance


@dataclass(frozen=True)
class Situation:
    """What a choice may depend on; a policy that is not clairvoyant looks at `snr` at most.

    Attributes
    ----------
    frame : int
        Number of the frame.
    temperature_k, tripped : [N]
        State of each drive's laser.
    snr : [N]
        Feature `signal_to_noise` of the last acquisition, 0 before the first.
    table : DriveTable
        What each action would bring.
    """

    frame: int
    temperature_k: np.ndarray
    tripped: np.ndarray
    snr: np.ndarray
    table: DriveTable

    @property
    def cost(self) -> np.ndarray:
        """Cost of each action in this frame, [N, A]."""
        return self.table.cost[:, self.frame]


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
    temperature_k, tripped = table.start_k.copy(), np.zeros(drives, dtype=bool)
    rows, actions = np.arange(drives), np.empty((drives, frames), np.int64)
    cost, snr = np.zeros(drives), np.zeros(drives)
    for frame in range(frames):
        chosen = choose(Situation(frame, temperature_k, tripped, snr, table))
        actions[:, frame] = np.where(tripped, -1, chosen)
        working = table.cost[rows, frame, chosen]
        cost += np.where(tripped, table.tripped_cost[:, frame], working)
        snr = np.where(tripped, snr, table.snr[rows, frame, chosen])
        heat_j = np.where(tripped, 0.0, table.heat_j[rows, frame, chosen])
        temperature_k, tripped = table.advance(temperature_k, tripped, heat_j)
    return Played(actions, cost)


def clairvoyant(table: DriveTable, *, levels: int = 801) -> Played:
    """Optimum over all choices, by dynamic programming on `levels` temperatures."""
    grid = np.linspace(*table.span_k, levels)
    values = _values_to_go(table, grid)
    drives = np.arange(table.cost.shape[0])

    def choose(now: Situation) -> np.ndarray:
        """Action of least cost now plus least cost from then on."""
        to_go = [
            _look_up(values[now.frame + 1], grid, *after)[drives]
            for after in _consequences(table, now.frame, now.temperature_k, now.tripped)
        ]
        return np.argmin(now.cost + np.stack(to_go, axis=-1), axis=-1)

    return play(table, choose)


def greedy(table: DriveTable, *, guarded: bool) -> Played:
    """Least cost of this frame alone; `guarded` avoids actions that trip the laser at once."""

    def choose(now: Situation) -> np.ndarray:
        after = _consequences(table, now.frame, now.temperature_k, now.tripped)
        trips = np.stack([tripped for _, tripped in after], axis=-1)
        barred = trips & ~trips.all(axis=-1, keepdims=True) & guarded
        return np.argmin(np.where(barred, np.inf, now.cost), axis=-1)

    return play(table, choose)


def fixed(action: int) -> Choice:
    """Choose `action` in every frame."""
    return lambda now: np.full(now.tripped.shape, action)


def cycle(pattern: tuple[int, ...]) -> Choice:
    """Repeat a pattern of actions, frame after frame."""
    return lambda now: np.full(now.tripped.shape, pattern[now.frame % len(pattern)])


def mixture(shares: tuple[float, float, float], *, seed: int = 0) -> Choice:
    """Draw each action with a fixed probability, independently of everything."""
    edges = np.cumsum(shares)[:-1]

    def choose(now: Situation) -> np.ndarray:
        draw = np.random.default_rng((seed, now.frame)).random(now.tripped.shape)
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


def _values_to_go(table: DriveTable, grid: np.ndarray) -> np.ndarray:
    """Least cost from each frame on, [T + 1, 2 (tripped), N, grid levels]."""
    drives, frames, _ = table.cost.shape
    values = np.zeros((frames + 1, 2, drives, grid.size))
    everywhere = np.broadcast_to(grid, (drives, grid.size))
    off = np.ones(everywhere.shape, dtype=bool)
    for frame in reversed(range(frames)):
        after = _consequences(table, frame, everywhere, ~off)
        to_go = [_look_up(values[frame + 1], grid, *state) for state in after]
        cost = table.cost[:, frame].T[:, :, None]
        values[frame, 0] = np.min(cost + np.stack(to_go), axis=0)
        cooled = table.advance(everywhere, off, np.zeros(everywhere.shape))
        values[frame, 1] = table.tripped_cost[:, frame, None] + _look_up(
            values[frame + 1], grid, *cooled
        )
    return values


def _consequences(
    table: DriveTable, frame: int, temperature_k: np.ndarray, tripped: np.ndarray
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Next (temperature, tripped) after each action, for temperatures [N] or [N, levels]."""
    heat_j = table.heat_j[:, frame].reshape(-1, *[1] * (temperature_k.ndim - 1), 3)
    return [
        table.advance(temperature_k, tripped, np.where(tripped, 0.0, heat_j[..., action]))
        for action in range(heat_j.shape[-1])
    ]


def _look_up(
    values: np.ndarray, grid: np.ndarray, temperature_k: np.ndarray, tripped: np.ndarray
) -> np.ndarray:
    """Interpolate values [2, N, levels] at a temperature and trip per drive ([N] or [N, K])."""
    position = (temperature_k - grid[0]) / (grid[1] - grid[0])
    position = np.clip(position, 0.0, grid.size - 1.0)
    below = np.minimum(position.astype(np.int64), grid.size - 2)
    weight = position - below
    drive = np.arange(len(temperature_k)).reshape(-1, *[1] * (temperature_k.ndim - 1))
    state = tripped.astype(np.int64)
    return (1.0 - weight) * values[state, drive, below] + weight * values[state, drive, below + 1]
