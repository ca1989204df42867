"""All that goes from one frame to the next, in one explicit value."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.decision.drive import Drive
from shotenv.decision.features import SEEN_FEATURES
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
    duty, power : float64 [B]
        Exponential averages of the reward's terms over `RECENT_S`, relative to always 8.
    """

    features: Tensor
    shots: Tensor
    since_four: Tensor
    since_eight: Tensor
    duty: Tensor
    power: Tensor

    @classmethod
    def nothing(cls, batch: int) -> Seen:
        """What is known before the first frame of `batch` drives."""
        # Zeros, as after a frame without laser: neither has told anything.
        none, zero = torch.zeros(batch, dtype=torch.int64), torch.zeros(batch, dtype=torch.float64)
        never = torch.full((batch,), NEVER)
        return cls(torch.zeros(batch, len(SEEN_FEATURES)), none, never, never, zero, zero)

    def after(
        self, shots: Tensor, features: Tensor, duty: Tensor, power: Tensor, period_s: float
    ) -> Seen:
        """What is known one frame of `period_s` later, after `shots` [B] with their features."""
        # Weight of this frame in the averages; a frame longer than the time constant is all of it.
        share = min(1.0, period_s / RECENT_S)
        return Seen(
            features=features,
            shots=shots,
            since_four=(self.since_four + 1).masked_fill_(shots >= Shots.FOUR, 0),
            since_eight=(self.since_eight + 1).masked_fill_(shots >= Shots.EIGHT, 0),
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
