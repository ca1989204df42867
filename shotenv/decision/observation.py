"""The observation: what is seen of the frame, what earlier frames told, the state of the drive."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.decision.features import LIMIT, STATE_FEATURES, Now, evaluated
from shotenv.decision.problem import Problem
from shotenv.decision.state import State


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
