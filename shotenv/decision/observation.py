"""The observation of a state: what was seen of the frame, what was told before, the state itself."""

from __future__ import annotations

import torch
from torch import Tensor

from shotenv.decision.features import LIMIT, STATE_FEATURES, Now, evaluated
from shotenv.decision.problem import Problem
from shotenv.decision.state import State


@torch.inference_mode()
def observe(problem: Problem, state: State) -> Tensor:
    """Features float32 [B, len(FEATURES)] in [-LIMIT, LIMIT], in the order of `FEATURES`."""
    scene = problem.scenes.features[state.drive.frame(state.step)]
    current = evaluated(STATE_FEATURES, _now(problem, state))
    return torch.cat((scene, state.seen.features, current), dim=1).clamp_(-LIMIT, LIMIT)


def _now(problem: Problem, state: State) -> Now:
    drive, seen, laser = state.drive, state.seen, problem.config.laser
    frame, before = drive.frame(state.step), drive.frame((state.step - 1).clamp(min=0))
    temperature_k = state.laser.temperature_k
    limit_k = torch.where(state.laser.tripped, laser.release_k, laser.trip_k)
    since_four, since_eight = seen.since.unbind(1)
    duty, power = seen.used.unbind(1)
    return Now(
        gray_change=problem.scenes.change(before, frame),
        shots=seen.shots,
        since_four=since_four,
        since_eight=since_eight,
        above_release_k=temperature_k - laser.release_k,
        margin_k=limit_k - temperature_k,
        duty=duty,
        power=power,
        step=state.step,
        frames=problem.config.frames_per_drive,
    )
