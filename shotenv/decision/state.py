"""All that goes from one frame to the next, in one explicit value."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from shotenv.decision.drive import Drive
from shotenv.laser import LaserState


@dataclass(frozen=True)
class Seen:
    """What earlier frames told; batch B.

    Attributes
    ----------
    features : float32 [B, len(SEEN_FEATURES)]
        Each of the last acquisition with enough samples to tell it; 0 before the first.
    shots : int64 [B]
        Of the last frame; 0 without laser, or before the first frame.
    since : int64 [B, 2]
        Frames since the last one with at least 4, and with 8 samples.
    used : float64 [B, 2]
        Exponential averages of duty and power over `RECENT_S`, relative to always 8.
    """

    features: Tensor
    shots: Tensor
    since: Tensor
    used: Tensor


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
