"""All that goes from one frame to the next, in one explicit value, and what is observed of it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.decision.drive import Drive
from shotenv.decision.features import LIMIT, SEEN_FEATURES, STATE_FEATURES, Now, evaluated
from shotenv.decision.problem import Problem
from shotenv.laser import LaserState
from unwrap.signal import Shots

NEVER = 1000
"""Frames since an acquisition that has not been made: long, and the same in every drive."""
RECENT_S = 1.0
"""Time constant of the averages of duty and power."""


@dataclass(frozen=True)
class Seen:
    """What earlier frames told; batch B.

    Attributes
    ----------
    features : float32 [B, len(SEEN_FEATURES)]
        Each of the last acquisition with enough samples to tell it; 0 before the first.
    shots : int64 [B]
        Of the last frame; 0 without laser, or before the first frame.
    since_four, since_eight : int64 [B]
        Frames since the last one with at least 4, and with 8 samples.
    eight_at : int64 [B]
        Bank frame of the last one with 8 samples; before the first that of the drive's start.
    duty, power : float64 [B]
        Exponential averages of the reward's terms over `RECENT_S`, relative to always 8.
    """

    features: Tensor
    shots: Tensor
    since_four: Tensor
    since_eight: Tensor
    eight_at: Tensor
    duty: Tensor
    power: Tensor

    @classmethod
    def nothing(cls, first: Tensor) -> Seen:
        """What is known before the first frames, bank frames `first` [B], of drives."""
        # Zeros, as after a frame without laser: neither has told anything.
        none, zero = torch.zeros_like(first), torch.zeros_like(first, dtype=torch.float64)
        never, features = torch.full_like(first, NEVER), torch.zeros(len(first), len(SEEN_FEATURES))
        return cls(features, none, never, never, first, zero, zero)

    def after(
        self,
        frame: Tensor,
        shots: Tensor,
        features: Tensor,
        duty: Tensor,
        power: Tensor,
        period_s: float,
    ) -> Seen:
        """What is known one frame of `period_s` later.

        After `shots` [B] with their features in the bank frames `frame` [B].
        """
        # Weight of this frame in the averages; a frame longer than the time constant is all of it.
        share = min(1.0, period_s / RECENT_S)
        return Seen(
            features=features,
            shots=shots,
            since_four=(self.since_four + 1).masked_fill_(shots >= Shots.FOUR, 0),
            since_eight=(self.since_eight + 1).masked_fill_(shots >= Shots.EIGHT, 0),
            eight_at=torch.where(shots >= Shots.EIGHT, frame, self.eight_at),
            duty=self.duty.lerp(duty, share),
            power=self.power.lerp(power, share),
        )


@dataclass(frozen=True)
class State:
    """All that goes from one frame to the next; batch B.

    Attributes
    ----------
    drive : Drive
    step : int64 [B]
        Frames played.
    laser : LaserState
    seen : Seen
    """

    drive: Drive
    step: Tensor
    laser: LaserState
    seen: Seen


@torch.inference_mode()
def observe(problem: Problem, state: State) -> Tensor:
    """Features float32 [B, len(FEATURES)] in [-LIMIT, LIMIT], in the order of `FEATURES`."""
    drive, seen, laser, limits = state.drive, state.seen, state.laser, problem.config.laser
    # The first frame has none before it, and so no change.
    frame, before = drive.frame(state.step), drive.frame((state.step - 1).clamp(min=0))
    # What the laser heads for: its trip, or while it is off the end of the pause.
    limit_k = torch.where(laser.tripped, limits.release_k, limits.trip_k)
    now = Now(
        gray_change=problem.scenes.change(before, frame),
        change_since_eight=problem.scenes.change(seen.eight_at, frame),
        shots=seen.shots,
        since_four=seen.since_four,
        since_eight=seen.since_eight,
        above_release_k=laser.temperature_k - limits.release_k,
        margin_k=limit_k - laser.temperature_k,
        duty=seen.duty,
        power=seen.power,
        step=state.step,
        frames=problem.config.frames_per_drive,
        power_price=drive.power_price,
        laser_power_w=drive.laser_power_w,
        integration_s=drive.integration_s,
    )
    parts = (
        problem.scenes.features.index_select(0, frame),
        seen.features,
        evaluated(STATE_FEATURES, now),
    )
    return torch.cat(parts, dim=1).clamp_(-LIMIT, LIMIT)
