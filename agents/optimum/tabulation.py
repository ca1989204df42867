"""Outcome tables of the environment's drives: every action taken in every frame."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from gymnasium.utils import seeding
from torch import Tensor

from agents.optimum.outcome_table import Advance, DriveTable, ThermalState
from agents.policies import SNR_FEATURE
from shotenv.config import LaserConfig
from shotenv.decision import (
    SEEN_FEATURES,
    Drive,
    Outcomes,
    Problem,
    answered_actions,
    drive_of_seed,
    outcomes_of_all_actions,
    weighted,
)
from shotenv.env import drive_seed
from shotenv.laser import case_step, efficiency_at, junction_step, trip_step

SNR_COLUMN = [feature.name for feature in SEEN_FEATURES].index(SNR_FEATURE)


@dataclass(frozen=True)
class Possible:
    """Drives and the outcome of each action in every frame, before the reward weighs it.

    Playing every action is the slow part; weighing what came of it is not, so that one serves many
    prices of power.

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

    def table(self, *, price: float | None = None) -> DriveTable:
        """The table that choices are played on.

        Without derating: power that follows the temperature would change what is measured, and
        the outcomes would depend on the actions before.

        Parameters
        ----------
        price : float, optional
            Weight of power in all drives; each drive's own by default.
        """
        period_s, laser = self.problem.frame_period_s, self.problem.config.laser
        weights = self.problem.config.reward
        ambient_k = np.array([float(drive.ambient_k) for drive in self.drives])
        heat_j = self._stacked(lambda one: one.heat_j[0])
        prices = [drive.power_price for drive in self.drives]
        if price is not None:
            prices = [torch.full_like(own, price) for own in prices]
        cost, reference, off, dark = (
            np.stack(
                [
                    weighted(terms(one), own, weights).numpy()
                    for one, own in zip(self.outcomes, prices, strict=True)
                ]
            )
            for terms in (
                lambda one: one.terms,
                lambda one: one.reference,
                lambda one: one.tripped_terms,
                lambda one: {**one.tripped_terms, "tripped": torch.zeros(1)},
            )
        )
        # At 25 C the laser turns `efficiency` of its energy into light and the rest into heat; its
        # price is relative to the energy of always 8 DCS.
        laser_j = heat_j / (1.0 - laser.efficiency)
        whole_j = np.array([float(drive.always_eight.energy_j) for drive in self.drives])
        # What was not recorded cannot be chosen.
        cost[..., ~answered_actions(self.problem).numpy()] = np.inf
        return DriveTable(
            cost=cost,
            reference=reference,
            error=weights.error * self._stacked(lambda one: one.terms["error"]),
            depth_mae_m=self._stacked(lambda one: one.score.depth_mae_m),
            laser_cost=torch.cat(prices).numpy()[:, None] * laser_j / whole_j[:, None],
            surplus=lambda temperature_k: energy_surplus(temperature_k, laser),
            dark_cost=np.broadcast_to(dark.reshape(-1, 1), cost.shape[:2]),
            tripped_cost=np.broadcast_to(off.reshape(-1, 1), cost.shape[:2]),
            heat_j=heat_j,
            snr=self._stacked(lambda one: one.features[..., SNR_COLUMN]),
            start_k=np.array([float(drive.start_k) for drive in self.drives]),
            span_k=_span_k(ambient_k, heat_j, laser, period_s),
            highest_rise_k=laser.junction_resistance_k_per_w * _hottest_j(heat_j, laser) / period_s,
            advance=thermal_model(ambient_k, laser, period_s),
            scale=weights.scale,
            protect=self.problem.config.protect,
        )

    def clips(self) -> np.ndarray:
        """Number of the bank's clip that each frame is of, int64 [N, T]."""
        return clips_of(self.problem, frames_of(self.drives))

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
    # Gymnasium's own way from a seed to the generator of an environment, then the environment's.
    generator, _ = seeding.np_random(seed)
    return drive_of_seed(problem, drive_seed(generator))


def frames_of(drives: Sequence[Drive]) -> np.ndarray:
    """Bank frames that drives, batches of one, play, int64 [N, T]."""
    return torch.cat([drive.frames[:, :-1] for drive in drives]).numpy()


def clips_of(problem: Problem, frames: np.ndarray) -> np.ndarray:
    """Number of the bank's clip that each of its `frames` [...] is of."""
    starts = np.array([clip.start for clip in problem.bank.clips])
    return np.searchsorted(starts, frames, side="right") - 1


def energy_surplus(temperature_k: np.ndarray, laser: LaserConfig) -> np.ndarray:
    """Share by which light takes more electrical energy at a temperature than at 25 C."""
    # One zero broadcasts with everything: most lasers here have no slope, and grids are large.
    if not laser.efficiency_slope_per_k:
        return np.zeros(1)
    return laser.efficiency / efficiency_at(temperature_k, laser) - 1.0


def thermal_model(ambient_k: np.ndarray, laser: LaserConfig, period_s: float) -> Advance:
    """The laser's heat and trip over one frame, for drives with these ambient temperatures [N]."""

    def advance(now: ThermalState, heat_j: np.ndarray) -> ThermalState:
        around_k = ambient_k.reshape(-1, *[1] * (now.case_k.ndim - 1))
        heat_j = _heat_at(now.temperature_k, heat_j, laser)
        case_k = case_step(now.case_k, heat_j, around_k, laser, period_s)
        rise_k = now.rise_k
        if laser.junction_resistance_k_per_w:
            rise_k = junction_step(rise_k, heat_j, laser, period_s)
        return ThermalState(case_k, rise_k, trip_step(now.tripped, case_k + rise_k, laser))

    return advance


def _heat_at(temperature_k: np.ndarray, heat_j: np.ndarray, laser: LaserConfig) -> np.ndarray:
    """Heat at a temperature, of actions that leave `heat_j` at 25 C: what light does not take."""
    if not laser.efficiency_slope_per_k:
        return heat_j
    return heat_j * (1.0 + energy_surplus(temperature_k, laser) / (1.0 - laser.efficiency))


def _hottest_j(heat_j: np.ndarray, laser: LaserConfig) -> float:
    """Most heat of any frame of any drive."""
    return float(_heat_at(np.array(laser.trip_k), heat_j.max(), laser))


def _span_k(
    ambient_k: np.ndarray, heat_j: np.ndarray, laser: LaserConfig, period_s: float
) -> tuple[float, float]:
    """Coldest ambient, and what the hottest frame makes of a laser about to trip.

    A laser starts at the ambient temperature or above, and no frame heats one that has tripped.
    """
    hottest_j = _hottest_j(heat_j, laser)
    hottest = case_step(laser.trip_k, hottest_j, ambient_k, laser, period_s)
    return float(ambient_k.min()), max(float(hottest.max()), laser.trip_k)
