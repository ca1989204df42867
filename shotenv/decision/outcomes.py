"""What every action would bring in every frame: for optimum, tuning and warm start."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.config import ROOM_K
from shotenv.decision.drive import Drive
from shotenv.decision.features import TOLD
from shotenv.decision.measurement import Measurement, lost_depth, measure_frames
from shotenv.decision.problem import Problem
from shotenv.decision.rewards import reference_terms, reward, reward_terms
from shotenv.decision.score import DepthScore
from shotenv.decision.transition import SHOTS_OF_ACTION, answered_actions, cost_of
from unwrap.support import concatenate, mapped, take

ACTIONS = len(SHOTS_OF_ACTION)
MOST_PIXELS = 2**20
"""Measured at once: more would only take more memory."""


@dataclass(frozen=True)
class Outcomes:
    """What each action would bring in each frame of one drive, with a working laser at 25 C.

    Of recordings that do not answer an action what it would bring is NaN, but for energy and heat.

    Attributes
    ----------
    terms : dict of float64 [T, 3]
        Unweighted reward terms; "tripped" is 0.
    reference : dict of float64 [T]
        Terms of 4 DCS that the reward is relative to.
    reward : float64 [T, 3]
    heat_j, laser_energy_j : float64 [T, 3]
    score : DepthScore
        Fields [T, 3].
    features : float32 [T, 3, len(SEEN_FEATURES)]
        What the sensor would tell; 0 where the shots cannot.
    tripped_terms : dict of float64 [1]
        Terms of a frame without laser, the same in every frame.
    tripped_reward : float64 [T]
        Reward of a frame without laser.
    """

    terms: dict[str, Tensor]
    reference: dict[str, Tensor]
    reward: Tensor
    heat_j: Tensor
    laser_energy_j: Tensor
    score: DepthScore
    features: Tensor
    tripped_terms: dict[str, Tensor]
    tripped_reward: Tensor


@torch.inference_mode()
def outcomes_of_all_actions(problem: Problem, drive: Drive) -> Outcomes:
    """Play every action in every frame of `drive` (a batch of one), without its consequences."""
    weights, frames = problem.config.reward, problem.config.frames_per_drive
    # How warm the laser will be depends on the choices before; whoever plays on the table adds it.
    room_k = torch.full_like(drive.ambient_k, ROOM_K)

    measured = _measure_all(problem, drive)
    cost = cost_of(problem, drive, SHOTS_OF_ACTION, room_k)
    working = torch.zeros(frames, ACTIONS, dtype=torch.bool)
    terms = reward_terms(measured.score, cost, drive.always_eight, working)
    # What an action costs is the same in every frame.
    terms = {name: term.expand(frames, ACTIONS) for name, term in terms.items()}

    # A tripped laser takes no samples and costs what the chips need.
    off = cost_of(problem, drive, torch.zeros(1, dtype=torch.int64), room_k)
    lost = lost_depth(problem, 1)
    tripped_terms = reward_terms(lost, off, drive.always_eight, torch.ones(1, dtype=torch.bool))
    # One number in each frame, the same whatever the action.
    reference = reference_terms(measured.error_of_four[:, 0], drive)
    beside_each = {name: term.unsqueeze(-1) for name, term in reference.items()}
    return Outcomes(
        terms=terms,
        reference=reference,
        reward=reward(terms, beside_each, drive.power_price, weights),
        heat_j=cost.heat_j.expand(frames, ACTIONS),
        laser_energy_j=cost.laser_energy_j.expand(frames, ACTIONS),
        score=measured.score,
        features=torch.where(TOLD[SHOTS_OF_ACTION], measured.features, 0.0),
        tripped_terms=tripped_terms,
        tripped_reward=reward(tripped_terms, reference, drive.power_price, weights),
    )


def _measure_all(problem: Problem, drive: Drive) -> Measurement:
    """All three acquisitions of every frame of `drive`, fields [T, 3, ...].

    They share the noise of the longest, as the frames of fewer samples are prefixes of it.
    """
    frames = problem.config.frames_per_drive
    # The fewest samples are always answered.
    answered = int(answered_actions(problem).sum())
    steps = torch.arange(frames).repeat_interleave(answered)
    shots = SHOTS_OF_ACTION[:answered].repeat(frames)
    at_once = max(1, MOST_PIXELS // (problem.bank.height * problem.bank.width))
    measured = [
        measure_frames(problem, take(drive, torch.zeros_like(step)), step, taken)
        for step, taken in zip(steps.split(at_once), shots.split(at_once), strict=True)
    ]
    table = mapped(lambda rows: rows.unflatten(0, (frames, answered)), concatenate(measured))
    return mapped(lambda values: _filled(values, ACTIONS - answered), table)


def _filled(values: Tensor, count: int) -> Tensor:
    """Values [T, A, ...] with NaN for `count` more actions."""
    unknown = values[:, :1].expand(-1, count, *values.shape[2:])
    return torch.cat((values, torch.full_like(unknown, torch.nan)), dim=1)
