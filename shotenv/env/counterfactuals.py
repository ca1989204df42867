"""`outcomes=True`: what every action would have brought in a frame, beside what was chosen."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from shotenv.decision import Measure, Problem, State, answered_actions, step
from shotenv.env.arguments import ACTIONS
from shotenv.env.info import Columns, info_columns

TOLD = (
    "shots",
    "energy_j",
    "laser_energy_j",
    "temperature_k",
    "depth_mae_m",
    "depth_rmse_m",
    "wrap_accuracy",
    "valid_share",
    "within_0p1m",
    "tripped",
    "cost",
    "vector_reward",
)
"""Keys of `info` that are told of every action; `reward` stands beside them."""


def outcome_columns(
    problem: Problem, family_codes: Tensor, before: State, measure: Measure
) -> Columns:
    """What each action would bring in the frames at `before` [B]: arrays [B, 3, ...].

    Exact counterfactuals, not estimates: the transition is played with each of them, with the
    noise of the frame itself, and the one that is then chosen brings just this. Of actions that
    recordings do not answer nothing is known: NaN, or 0 where there is none.
    """
    tried: list[Columns] = []
    for action, answered in enumerate(answered_actions(problem).tolist()):
        if not answered:
            tried.append({name: _unknown(values) for name, values in tried[0].items()})
            continue
        actions = torch.full_like(before.step, action)
        after, outcome = step(problem, before, actions, measure=measure)
        columns = info_columns(problem, family_codes, before, after, outcome)
        tried.append({name: columns[name] for name in TOLD} | {"reward": outcome.reward.numpy()})
    return {name: np.stack([one[name] for one in tried], axis=1) for name in tried[0]}


def _unknown(values: np.ndarray) -> np.ndarray:
    return np.full_like(values, np.nan if values.dtype.kind == "f" else 0)


def no_outcomes(columns: Columns) -> Columns:
    """What stands for them before the first frame, of drives with the infos `columns`: zeros."""
    batch = len(columns["shots"])
    found = {
        name: np.zeros((batch, ACTIONS, *columns[name].shape[1:]), columns[name].dtype)
        for name in TOLD
    }
    return found | {"reward": np.zeros((batch, ACTIONS))}
