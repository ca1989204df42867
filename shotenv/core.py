"""The transition of the decision problem: pure, batched; state goes in and comes out.

problem = open_problem(config)
state = reset(problem, seeds)
state, outcome = step(problem, state, actions)
features = observe(problem, state)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice

import torch
from torch import Tensor

from shotenv.batch import concatenate, put, take
from shotenv.config import ROOM_K
from shotenv.drive import Drive, draw_drive
from shotenv.frames import ShotCost
from shotenv.laser import LaserState, emitted_power_w, laser_step, shot_cost, start_laser
from shotenv.measure import Measured, measure, noise_of
from shotenv.observe import FEATURES, LIMIT, SEEN_FEATURES, gray_change, heat_margin
from shotenv.problem import Problem, open_problem
from shotenv.reward import DepthScore, no_depth, reward, reward_terms
from unwrap.acquisition import Shots

__all__ = ["Outcome", "Outcomes", "Problem", "Seen", "State", "observe", "open_problem"]
__all__ += ["outcomes_of_all_actions", "reset", "step"]

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
class Seen:
    """What earlier frames told; batch B.

    Attributes
    ----------
    features : float32 [B, 6]
        Of the last acquisition that could tell, see `SEEN_FEATURES`; 0 before the first.
    shots : int64 [B]
        Of the last frame; 0 without laser, or before the first frame.
    since : int64 [B, 2]
        Frames since the last one with at least 4, and with 8 shots.
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
        `measure`, or something that gives the same faster (`shotenv.recall`).
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
    return measured.score, keep_untold(measured.seen, features)


def keep_untold(new: Tensor, old: Tensor) -> Tensor:
    """Features [B, 6] of an acquisition; what its shots cannot tell stays as it was."""
    return torch.cat((new, old[:, new.shape[1] :]), dim=1)


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


@torch.inference_mode()
def observe(problem: Problem, state: State) -> Tensor:
    """Features float32 [B, len(FEATURES)] in [-LIMIT, LIMIT], in the order of `FEATURES`."""
    drive, seen, laser = state.drive, state.seen, problem.config.laser
    temperature_k, tripped = state.laser.temperature_k, state.laser.tripped
    now, before = drive.frame(state.step), drive.frame((state.step - 1).clamp(min=0))
    margin_k = torch.where(tripped, laser.release_k, laser.trip_k) - temperature_k
    recently = 1.0 - torch.exp(seen.since / -16.0)
    columns = (
        gray_change(problem.scenes, before, now),
        seen.shots == Shots.TWO,
        seen.shots == Shots.FOUR,
        seen.shots == Shots.EIGHT,
        *recently.unbind(1),
        (temperature_k - laser.release_k) / 20.0,
        heat_margin(margin_k),
        *seen.used.unbind(1),
        1.0 - state.step * (2.0 / problem.config.frames_per_drive),
    )
    current = torch.stack([column.to(torch.float32) for column in columns], dim=1)
    features = torch.cat((problem.scenes.features[now], seen.features, current), dim=1)
    assert features.shape[1] == len(FEATURES)
    return features.clamp_(-LIMIT, LIMIT)


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
    return concatenate([Measured(m.score, keep_untold(m.seen, untold)) for m in measured])


def _stack(scores: Sequence[DepthScore], frames: int) -> DepthScore:
    joined = concatenate(scores)
    fields = [field.name for field in dataclasses.fields(joined)]
    return DepthScore(*(getattr(joined, name).unflatten(0, (frames, 3)) for name in fields))
