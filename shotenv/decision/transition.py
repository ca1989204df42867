"""The transition of the decision problem: pure, batched; state goes in and comes out.

problem = open_problem(config)
state = reset(problem, seeds)
state, outcome = step(problem, state, actions)
features = observe(problem, state)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from shotenv.bank import WordBank
from shotenv.decision.drive import DRAWN, Drive, DriveOptions, draw_drive
from shotenv.decision.measurement import Measure, measure_by_shots, measure_frames
from shotenv.decision.problem import Problem
from shotenv.decision.rewards import reference_terms, reward, reward_terms
from shotenv.decision.score import DepthScore
from shotenv.decision.state import Seen, State
from shotenv.laser import (
    LaserState,
    ShotCost,
    emitted_power_w,
    heat_of,
    laser_step,
    shot_cost,
    start_laser,
    warmed_k,
)
from unwrap.signal import Shots
from unwrap.support import concatenate

SHOTS_OF_ACTION = torch.tensor([int(shots) for shots in Shots])
"""Samples that each action asks for: 2, 4, 8."""
NEXT_LOWER = torch.tensor([0, 0, 0, 0, 2, 0, 0, 0, 4])
"""Samples of the next shorter acquisition, by number of samples; none below two."""


@dataclass(frozen=True)
class Outcome:
    """What one frame brought; batch B.

    Attributes
    ----------
    reward : float64 [B]
    terms : dict of float64 [B]
        Unweighted reward terms.
    asked, shots : int64 [B]
        Samples asked for, and taken: fewer where the sensor protects itself, 0 without laser.
    score : DepthScore
    cost : ShotCost
    tripped : bool [B]
        The laser was off.
    truncated : bool [B]
        The drive is over.
    """

    reward: Tensor
    terms: dict[str, Tensor]
    asked: Tensor
    shots: Tensor
    score: DepthScore
    cost: ShotCost
    tripped: Tensor
    truncated: Tensor


@torch.inference_mode()
def reset(problem: Problem, seeds: Sequence[int], options: DriveOptions = DRAWN) -> State:
    """Start of the drives with the given seeds, one for each environment of the batch.

    `options` set something of all of them.
    """
    drive = concatenate([drive_of_seed(problem, seed, options) for seed in seeds])
    played = torch.zeros(len(seeds), dtype=torch.int64)
    seen = Seen.nothing(drive.frame(played))
    return State(drive, played, start_laser(drive.start_k), seen)


def drive_of_seed(problem: Problem, seed: int, options: DriveOptions = DRAWN) -> Drive:
    """The drive of `seed` through the clips of `problem`, a batch of one; see `draw_drive`."""
    bank = problem.bank
    return draw_drive(
        seed,
        problem.config,
        problem.clips,
        bank.height,
        bank.width,
        network=problem.network_work,
        options=options,
        recorded=bank.settings if isinstance(bank, WordBank) else None,
    )


@torch.inference_mode()
def step(
    problem: Problem, state: State, actions: Tensor, *, measure: Measure = measure_frames
) -> tuple[State, Outcome]:
    """Play one frame of every drive.

    Parameters
    ----------
    actions : int64 [B]
        0 = 2 DCS, 1 = 4 DCS, 2 = 8 DCS; a sensor that protects itself may take fewer, see
        `granted`, and a laser that is off takes none.
    measure : callable
        `measure_frames`, or a `MeasurementCache`, which gives the same.

    Raises
    ------
    ValueError
        An action asks for samples that were not recorded.
    """
    config, period_s = problem.config, problem.frame_period_s
    drive, laser = state.drive, state.laser

    # What is asked for, what the laser can give, and what the frame then brings and costs.
    asked = SHOTS_OF_ACTION.take(actions)
    if isinstance(problem.bank, WordBank):
        problem.bank.require_answer(asked)
    shots = granted(problem, drive, laser, asked).masked_fill(laser.tripped, 0)
    power_w = emitted_power_w(drive.laser_power_w, laser.temperature_k, config.laser)
    measured = measure_by_shots(problem, state, shots, power_w, measure)
    cost = cost_of(problem, drive, shots, laser.temperature_k)
    terms = reward_terms(measured.score, cost, drive.always_eight, laser.tripped)

    # All that the next frame will know of this one: its heat, and what was seen.
    # Heat of this frame acts from the next one on; within it the laser is as warm as at its start.
    warmed = laser_step(laser, cost, drive.ambient_k, config.laser, period_s)
    seen = state.seen.after(
        drive.frame(state.step), shots, measured.features, terms["duty"], terms["power"], period_s
    )
    following = State(drive, state.step + 1, warmed, seen)
    reference = reference_terms(measured.error_of_four, drive)
    return following, Outcome(
        reward=reward(terms, reference, drive.power_price, config.reward),
        terms=terms,
        asked=asked,
        shots=shots,
        score=measured.score,
        cost=cost,
        tripped=laser.tripped,
        truncated=following.step >= config.frames_per_drive,
    )


def granted(problem: Problem, drive: Drive, laser: LaserState, asked: Tensor) -> Tensor:
    """Samples [B] that the sensor takes of those asked for, int64 [B].

    A sensor that protects itself takes the next lower number, in the end none, where those asked
    for would bring the laser to its trip in this frame: a frame without laser is one, a trip many.
    """
    if not problem.config.protect:
        return asked
    shots = asked
    # Most frames are far from the trip, and one look is enough for all.
    for _ in Shots:
        too_hot = would_trip(problem, drive, laser, shots) & (shots > 0)
        if not too_hot.any():
            break
        shots = torch.where(too_hot, NEXT_LOWER.take(shots), shots)
    return shots


def allowed_actions(problem: Problem, state: State) -> Tensor:
    """Which actions the laser can take as they are without tripping, bool [B, 3].

    Fewest samples always; and all while the laser is off, for none is taken then. Of samples that
    were recorded only those that are there.
    """
    cool = torch.stack(
        [
            ~would_trip(problem, state.drive, state.laser, torch.full_like(state.step, n))
            | (n == Shots.TWO)
            for n in SHOTS_OF_ACTION.tolist()
        ],
        dim=1,
    )
    return cool & answered_actions(problem)


def answered_actions(problem: Problem) -> Tensor:
    """Which actions the bank can answer, bool [3]: all where it has light."""
    return torch.tensor([shots in problem.bank.answers for shots in Shots])


def would_trip(problem: Problem, drive: Drive, laser: LaserState, shots: Tensor) -> Tensor:
    """Where taking `shots` [B] would trip a laser that works, bool [B]."""
    config, before_k = problem.config.laser, laser.temperature_k
    # Heat alone, and not the whole cost: every frame asks, often more than once.
    heat_j = heat_of(
        shots,
        config,
        optical_power_w=emitted_power_w(drive.laser_power_w, before_k, config),
        temperature_k=before_k,
        integration_s=drive.integration_s,
    )
    after_k, _ = warmed_k(laser, heat_j, drive.ambient_k, config, problem.frame_period_s)
    return (after_k >= config.trip_k) & ~laser.tripped


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
        network=problem.network_work,
    )
