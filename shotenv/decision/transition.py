"""The transition of the decision problem: pure, batched; state goes in and comes out.

problem = open_problem(config)
state = reset(problem, seeds)
state, outcome = step(problem, state, actions)
features = observe(problem, state)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.decision.acquire import Measured, measure
from shotenv.decision.drive import Drive, draw_drive
from shotenv.decision.features import SEEN_FEATURES, TOLD
from shotenv.decision.problem import Problem
from shotenv.decision.rewards import reward, reward_terms
from shotenv.decision.score import DepthScore, no_depth
from shotenv.decision.state import Seen, State
from shotenv.laser import ShotCost, emitted_power_w, laser_step, shot_cost, start_laser
from unwrap.signal import Shots
from unwrap.support import concatenate, put, take

SHOTS_OF_ACTION = torch.tensor([int(shots) for shots in Shots])
FEWER = torch.tensor([[int(shots < least) for least in (4, 8)] for shots in range(9)])
"""Whether a number of samples is less than 4, and less than 8; 1 or 0."""
NEVER = 1000
"""Frames since an acquisition that has not been made."""
RECENT_S = 1.0
"""Time constant of the averages of duty and power."""
Look = Callable[[Problem, Drive, Tensor, Shots, Tensor | None], Measured]
"""Acquires the frames at a step of some drives, with a laser power or the drives' own."""


@dataclass(frozen=True)
class Outcome:
    """What one frame brought; batch B.

    Attributes
    ----------
    reward : float64 [B]
    terms : dict of float64 [B]
        Unweighted reward terms.
    shots : int64 [B]
        Samples taken; 0 without laser.
    score : DepthScore
    cost : ShotCost
    tripped : bool [B]
        The laser was off.
    truncated : bool [B]
        The drive is over.
    """

    reward: Tensor
    terms: dict[str, Tensor]
    shots: Tensor
    score: DepthScore
    cost: ShotCost
    tripped: Tensor
    truncated: Tensor


@torch.inference_mode()
def reset(problem: Problem, seeds: Sequence[int]) -> State:
    """Start of the drives with the given seeds, one for each environment of the batch."""
    bank = problem.bank
    drive = concatenate(
        [draw_drive(s, problem.config, problem.clips, bank.height, bank.width) for s in seeds]
    )
    none = torch.zeros(len(seeds), dtype=torch.int64)
    return State(
        drive=drive,
        step=none,
        laser=start_laser(drive.start_k),
        seen=Seen(
            features=torch.zeros(len(seeds), len(SEEN_FEATURES)),
            shots=none,
            since=torch.full((len(seeds), 2), NEVER),
            used=torch.zeros(len(seeds), 2, dtype=torch.float64),
        ),
    )


@torch.inference_mode()
def step(
    problem: Problem, state: State, actions: Tensor, *, look: Look = measure
) -> tuple[State, Outcome]:
    """Play one frame of every drive.

    Parameters
    ----------
    actions : int64 [B]
        0 = 2 DCS, 1 = 4 DCS, 2 = 8 DCS; a laser that is off takes none.
    look : callable
        `measure`, or something that gives the same faster (`shotenv.decision.recall`).
    """
    tripped = state.laser.tripped
    shots = SHOTS_OF_ACTION.take(actions).masked_fill(tripped, 0)
    score, features = _measure_by_shots(problem, state, shots, look)
    cost = cost_of(problem, state.drive, shots, state.laser.temperature_k)
    terms = reward_terms(score, cost, state.drive.always_eight, tripped)
    following = advance(problem, state, cost, _remember(problem, state, shots, terms, features))
    outcome = Outcome(
        reward=reward(terms, problem.config.reward),
        terms=terms,
        shots=shots,
        score=score,
        cost=cost,
        tripped=tripped,
        truncated=following.step >= problem.config.frames_per_drive,
    )
    return following, outcome


def _measure_by_shots(
    problem: Problem, state: State, shots: Tensor, look: Look
) -> tuple[DepthScore, Tensor]:
    """Scores and remembered features; environments with the same shots are one batch."""
    features, counts = state.seen.features, sorted(set(shots.tolist()))
    power_w = derated_w(problem, state)
    if len(counts) == 1 and counts[0]:
        return _look_as(Shots(counts[0]), problem, state.drive, state.step, power_w, features, look)
    score = no_depth(len(shots), problem.config.sensor.max_range_m)
    for count in counts:
        if count:
            rows = (shots == count).nonzero().squeeze(1)
            drive, before = take(state.drive, rows), features[rows]
            power = None if power_w is None else power_w[rows]
            part, told = _look_as(
                Shots(count), problem, drive, state.step[rows], power, before, look
            )
            score, features = put(score, rows, part), put(features, rows, told)
    return score, features


def _look_as(
    shots: Shots,
    problem: Problem,
    drive: Drive,
    step: Tensor,
    power_w: Tensor | None,
    features: Tensor,
    look: Look,
) -> tuple[DepthScore, Tensor]:
    measured = look(problem, drive, step, shots, power_w)
    return measured.score, keep_untold(shots, measured.seen, features)


def keep_untold(shots: Shots, new: Tensor, old: Tensor) -> Tensor:
    """Features [B, S] of an acquisition; what its samples cannot tell stays as it was."""
    return torch.where(TOLD[shots], new, old)


def derated_w(problem: Problem, state: State) -> Tensor | None:
    """Optical power [B] while on, W; None is the drive's own, where nothing derates it."""
    laser = problem.config.laser
    if not laser.derate_per_k:
        return None
    return emitted_power_w(state.drive.laser_power_w, state.laser.temperature_k, laser)


def cost_of(problem: Problem, drive: Drive, shots: Tensor, temperature_k: Tensor) -> ShotCost:
    """What `shots` [B] cost with each drive's laser at a junction temperature [B]."""
    laser = problem.config.laser
    return shot_cost(
        shots,
        laser,
        optical_power_w=emitted_power_w(drive.laser_power_w, temperature_k, laser),
        temperature_k=temperature_k,
        integration_s=drive.integration_s,
        frame_period_s=problem.frame_period_s,
        network_macs=problem.network_macs,
    )


def _remember(
    problem: Problem, state: State, shots: Tensor, terms: dict[str, Tensor], features: Tensor
) -> Seen:
    share, seen = min(1.0, problem.frame_period_s / RECENT_S), state.seen
    fewer = FEWER.index_select(0, shots)
    return Seen(
        features=features,
        shots=shots,
        since=torch.addcmul(fewer, fewer, seen.since),
        used=seen.used.lerp(torch.stack((terms["duty"], terms["power"]), dim=1), share),
    )


def advance(problem: Problem, state: State, cost: ShotCost, seen: Seen) -> State:
    """The laser's heat, and the next frame."""
    config, ambient_k = problem.config.laser, state.drive.ambient_k
    laser = laser_step(state.laser, cost, ambient_k, config, problem.frame_period_s)
    return State(state.drive, state.step + 1, laser, seen)
