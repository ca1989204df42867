"""The `info` dictionaries of environments: plain numbers, one dictionary per drive."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import torch

from shotenv.decision import TERMS, Outcome, Problem, State
from shotenv.laser import ENERGY_PARTS, too_bright


def reset_infos(problem: Problem, state: State) -> list[dict[str, Any]]:
    """What is told of each drive at its start: seed, sensor draw, temperature, family."""
    drive = state.drive
    columns = {
        "drive_seed": drive.seed.tolist(),
        "laser_power_w": drive.laser_power_w.tolist(),
        "integration_s": drive.integration_s.tolist(),
        "ambient_k": drive.ambient_k.tolist(),
        "temperature_k": state.laser.temperature_k.tolist(),
        "family": _families(problem, state),
    }
    return _rows(columns)


def step_infos(
    problem: Problem, before: State, after: State, outcome: Outcome
) -> list[dict[str, Any]]:
    """What is told of each frame that was played.

    `cost` is the constraint violation: 1 in a frame without laser, or after which the light
    averaged for eye safety exceeds its cap. `vector_reward` holds the unweighted `reward_terms` in
    the order of `TERMS`.
    """
    cost, score, laser = outcome.cost, outcome.score, problem.config.laser
    # Light is judged after the frame, since it is what the frame has added that may exceed the cap.
    violated = outcome.tripped | too_bright(after.laser, laser)
    columns = {
        "shots": outcome.shots.tolist(),
        "energy_j": cost.energy_j.tolist(),
        **{name: getattr(cost, name).tolist() for name in ENERGY_PARTS},
        "duty": cost.duty.tolist(),
        "power_w": (cost.energy_j / problem.frame_period_s).tolist(),
        "temperature_k": after.laser.temperature_k.tolist(),
        "life_used_h": cost.life_used_h.tolist(),
        "eye_power_w": after.laser.eye_power_w.tolist(),
        "tripped": outcome.tripped.tolist(),
        "cost": violated.double().tolist(),
        "family": _families(problem, before),
    }
    fields = [field.name for field in dataclasses.fields(score) if field.name != "error"]
    columns |= {name: getattr(score, name).tolist() for name in fields}
    terms = torch.stack([outcome.terms[name] for name in TERMS], dim=1).tolist()
    return [
        row
        | {
            "reward_terms": dict(zip(TERMS, values, strict=True)),
            "vector_reward": np.array(values, np.float32),
        }
        for row, values in zip(_rows(columns), terms, strict=True)
    ]


def _rows(columns: dict[str, list]) -> list[dict[str, Any]]:
    values = zip(*columns.values(), strict=True)
    return [dict(zip(columns, row, strict=True)) for row in values]


def _families(problem: Problem, state: State) -> list[str]:
    frames = state.drive.frame(state.step).tolist()
    return [problem.bank.clip_of(frame).family for frame in frames]
