"""What the laser carries from one frame to the next."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.config import LaserConfig
from shotenv.laser.cost import ShotCost
from shotenv.laser.thermal import case_step, junction_step, relaxed, trip_step


@dataclass(frozen=True)
class LaserState:
    """The laser between two frames; batch B.

    Attributes
    ----------
    temperature_k : float64 [B]
        Of the junction: it trips, derates and ages.
    junction_rise_k : float64 [B]
        Of the junction above the case; 0 without a junction stage.
    eye_power_w : float64 [B]
        Running average of the emitted power, see `laser_step`.
    tripped : bool [B]
        Off in the coming frame.
    """

    temperature_k: Tensor
    junction_rise_k: Tensor
    eye_power_w: Tensor
    tripped: Tensor


def start_laser(case_k: Tensor) -> LaserState:
    """A laser that has long been off, with its case at `case_k` [B]."""
    zero = torch.zeros_like(case_k)
    return LaserState(case_k, zero, zero, zero.bool())


def laser_step(
    state: LaserState, cost: ShotCost, ambient_k: Tensor, laser: LaserConfig, period_s: float
) -> LaserState:
    """The laser one frame later.

    The average for eye safety is exponential: the mean power of a frame enters with the weight
    1 - exp(-period / `eye_window_s`) and the average before it with the rest, from 0 at the start.
    For constant power it is that power once several windows have passed; a standard's
    rectangular window has the same steady value.
    """
    temperature_k, rise_k = warmed_k(state, cost.heat_j, ambient_k, laser, period_s)
    eye_w = cost.optical_j / period_s
    if laser.eye_window_s:
        eye_w = relaxed(state.eye_power_w, eye_w, laser.eye_window_s, period_s)
    return LaserState(temperature_k, rise_k, eye_w, trip_step(state.tripped, temperature_k, laser))


def warmed_k(
    state: LaserState, heat_j: Tensor, ambient_k: Tensor, laser: LaserConfig, period_s: float
) -> tuple[Tensor, Tensor]:
    """Temperature and rise of the junction [B] one frame later, after `heat_j` [B]."""
    # Case and junction each answer the whole heat flow (see `thermal`); their sum is what trips.
    rise_k = state.junction_rise_k
    case_k = case_step(state.temperature_k - rise_k, heat_j, ambient_k, laser, period_s)
    if laser.junction_resistance_k_per_w:
        rise_k = junction_step(rise_k, heat_j, laser, period_s)
    return case_k + rise_k, rise_k


def too_bright(state: LaserState, laser: LaserConfig) -> Tensor:
    """Where the average power exceeds the cap for eyes, bool [B]; nowhere without a cap."""
    # A limit of 0 switches the cap off; it does not forbid all light.
    return state.eye_power_w > (laser.eye_limit_w or float("inf"))
