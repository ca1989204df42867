"""What every action would bring in every frame: for optimum, tuning and warm start."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import torch
from torch import Tensor

from shotenv.config import ROOM_K
from shotenv.decision.acquire import Measured, measure, noise_of
from shotenv.decision.drive import Drive
from shotenv.decision.features import (
    SEEN_FEATURES,
)
from shotenv.decision.problem import Problem
from shotenv.decision.rewards import reward, reward_terms
from shotenv.decision.score import DepthScore, no_depth
from shotenv.decision.transition import (
    SHOTS_OF_ACTION,
    cost_of,
    keep_untold,
)
from unwrap.signal import Shots
from unwrap.support import concatenate


@dataclass(frozen=True)
class Outcomes:
    """What each action would bring in each frame of one drive, with a working laser at 25 C.

    Attributes
    ----------
    terms : dict of float64 [T, 3]
        Unweighted reward terms; "tripped" is 0.
    reward : float64 [T, 3]
    heat_j : float64 [T, 3]
    score : DepthScore
        Fields [T, 3].
    features : float32 [T, 3, 6]
        What the sensor would tell; 0 where the shots cannot.
    tripped_terms : dict of float64
        Terms of a frame without laser, the same in every frame.
    """

    terms: dict[str, Tensor]
    reward: Tensor
    heat_j: Tensor
    score: DepthScore
    features: Tensor
    tripped_terms: dict[str, Tensor]
    tripped_reward: float


@torch.inference_mode()
def outcomes_of_all_actions(problem: Problem, drive: Drive) -> Outcomes:
    """Play every action in every frame of `drive` (a batch of one), without its consequences."""
    steps = torch.arange(problem.config.frames_per_drive)
    measured = [_measure_all(problem, drive, step.unsqueeze(0)) for step in steps]
    score = _stack([m.score for m in measured], len(steps))
    features = torch.cat([m.seen for m in measured]).unflatten(0, (len(steps), 3))
    room_k = torch.full_like(drive.ambient_k, ROOM_K)
    cost = cost_of(problem, drive, SHOTS_OF_ACTION, room_k)
    working = torch.zeros(len(steps), 3, dtype=torch.bool)
    terms = reward_terms(score, cost, drive.always_eight, working)
    off = cost_of(problem, drive, torch.zeros(1, dtype=torch.int64), room_k)
    lost = no_depth(1, problem.config.sensor.max_range_m)
    tripped_terms = reward_terms(lost, off, drive.always_eight, torch.ones(1, dtype=torch.bool))
    everywhere = {name: value.expand(len(steps), 3) for name, value in terms.items()}
    return Outcomes(
        terms=everywhere,
        reward=reward(everywhere, problem.config.reward),
        heat_j=cost.heat_j.expand(len(steps), 3),
        score=score,
        features=features,
        tripped_terms=tripped_terms,
        tripped_reward=float(reward(tripped_terms, problem.config.reward)),
    )


def _measure_all(problem: Problem, drive: Drive, step: Tensor) -> Measured:
    """All three acquisitions of one frame; they share the noise of the longest."""
    noise = list(
        islice(noise_of(drive, step, problem.bank.height, problem.bank.width), Shots.EIGHT)
    )
    measured = [measure(problem, drive, step, shots, noise=noise) for shots in Shots]
    untold = torch.zeros(1, len(SEEN_FEATURES))
    return concatenate(
        [
            Measured(one.score, keep_untold(shots, one.seen, untold))
            for shots, one in zip(Shots, measured, strict=True)
        ]
    )


def _stack(scores: Sequence[DepthScore], frames: int) -> DepthScore:
    joined = concatenate(scores)
    fields = [field.name for field in dataclasses.fields(joined)]
    return DepthScore(*(getattr(joined, name).unflatten(0, (frames, 3)) for name in fields))
