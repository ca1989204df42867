"""From the environment's problem to the table of everything that its drives can turn out to be."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from gymnasium.utils import seeding
from torch import Tensor

from agents.optimum import Advance, DriveTable
from agents.policies import SNR_FEATURE
from shotenv.config import LaserConfig, RewardConfig
from shotenv.core import Outcomes, Problem, outcomes_of_all_actions
from shotenv.drive import Drive, draw_drive
from shotenv.env import drive_seed
from shotenv.laser import thermal_step, trip_step
from shotenv.observe import SEEN_FEATURES
from shotenv.reward import reward

SNR_COLUMN = list(SEEN_FEATURES).index(SNR_FEATURE)


@dataclass(frozen=True)
class Possible:
    """Drives and everything that could happen in them, before the reward weighs it.

    Attributes
    ----------
    problem : Problem
    drives : tuple of Drive
        Batches of one.
    outcomes : tuple of Outcomes
        Of each drive.
    """

    problem: Problem
    drives: tuple[Drive, ...]
    outcomes: tuple[Outcomes, ...]

    def table(self, weights: RewardConfig) -> DriveTable:
        """The table that choices are played on, with these reward weights."""
        period_s, laser = self.problem.frame_period_s, self.problem.config.laser
        ambient_k = np.array([float(drive.ambient_k) for drive in self.drives])
        heat_j = self._stacked(lambda one: one.heat_j)
        off = self._stacked(lambda one: -reward(one.tripped_terms, weights))
        return DriveTable(
            cost=self._stacked(lambda one: -reward(one.terms, weights)),
            tripped_cost=np.broadcast_to(off.reshape(-1, 1), heat_j.shape[:2]),
            heat_j=heat_j,
            snr=self._stacked(lambda one: one.features[..., SNR_COLUMN]),
            start_k=np.array([float(drive.start_k) for drive in self.drives]),
            span_k=_span_k(ambient_k, heat_j, laser, period_s),
            advance=thermal_model(ambient_k, laser, period_s),
        )

    def _stacked(self, of: Callable[[Outcomes], Tensor]) -> np.ndarray:
        return np.stack([of(one).numpy().astype(np.float64) for one in self.outcomes])


def tabulate(
    problem: Problem, seeds: Sequence[int], *, tick: Callable[[int], object] = lambda frames: None
) -> Possible:
    """Play every action in every frame of the drives that environments have with these seeds.

    `tick` is told the number of frames after each drive.
    """
    drives, outcomes = [], []
    for seed in seeds:
        drives.append(drive_of(problem, seed))
        outcomes.append(outcomes_of_all_actions(problem, drives[-1]))
        tick(problem.config.frames_per_drive)
    return Possible(problem, tuple(drives), tuple(outcomes))


def drive_of(problem: Problem, seed: int) -> Drive:
    """The first drive of an environment after `reset(seed=seed)`."""
    generator, _ = seeding.np_random(seed)
    bank, config = problem.bank, problem.config
    return draw_drive(drive_seed(generator), config, problem.clips, bank.height, bank.width)


def thermal_model(ambient_k: np.ndarray, laser: LaserConfig, period_s: float) -> Advance:
    """The laser's heat and trip over one frame, for drives with these ambient temperatures [N]."""

    def advance(
        temperature_k: np.ndarray, tripped: np.ndarray, heat_j: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        around_k = ambient_k.reshape(-1, *[1] * (temperature_k.ndim - 1))
        warm = thermal_step(temperature_k, heat_j, around_k, laser, period_s)
        return warm, trip_step(tripped, warm, laser)

    return advance


def _span_k(
    ambient_k: np.ndarray, heat_j: np.ndarray, laser: LaserConfig, period_s: float
) -> tuple[float, float]:
    """Coldest ambient, and what the hottest frame makes of a laser about to trip."""
    hottest = thermal_step(laser.trip_k, heat_j.max(axis=(1, 2)), ambient_k, laser, period_s)
    return float(ambient_k.min()), max(float(hottest.max()), laser.trip_k)
