"""`info`: one table of what is told of a drive and of the frame that was played.

The same keys with the same types of numbers after `reset` and after `step`, so that whatever
stacks infos (vector environments, recorders, tensors) can rely on them. A new entry is a new line.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np
import torch
from torch import Tensor

from shotenv.bank import Bank
from shotenv.config import Family
from shotenv.decision import TERMS, Outcome, Problem, State
from shotenv.laser import too_bright

Columns = dict[str, Any]
"""Infos of a batch B: an array [B, ...] for each key, or again `Columns`."""


@dataclass(frozen=True)
class Played:
    """What infos are made of: a frame of a batch of drives, or their start.

    Attributes
    ----------
    problem : Problem
    family_codes : int64 [N]
        Code of the family of each bank frame, see `family_names`.
    before, after : State
        Around the frame; the same at the start of a drive.
    outcome : Outcome or None
        What the frame brought; None at the start of a drive.
    """

    problem: Problem
    family_codes: Tensor
    before: State
    after: State
    outcome: Any


class Entry(NamedTuple):
    """One key of `info`.

    Attributes
    ----------
    name, unit, meaning : str
    value : callable
        Its number for each of the drives, [B].
    at_start : bool, int, float or None
        What stands for it after `reset`, when no frame has been played; its type is that of the
        number. None where `value` does not ask for a frame.
    """

    name: str
    unit: str
    meaning: str
    value: Callable[[Played], Tensor]
    at_start: bool | int | float | None = None


def violated(played: Played) -> Tensor:
    """Frames without laser, or after which the light averaged for eye safety exceeds its cap."""
    # Light is judged after the frame, since it is what the frame has added that may exceed the cap.
    return played.outcome.tripped | too_bright(played.after.laser, played.problem.config.laser)


# One line for each, however long: name, unit, meaning and formula are read together.
# fmt: off
INFO_ENTRIES = (
    Entry("drive_seed", "1", "seed of the drive; `options={\"drive\": seed}` plays it again", lambda p: p.before.drive.seed),
    Entry("laser_power_w", "W", "optical power of this drive's laser while on", lambda p: p.before.drive.laser_power_w),
    Entry("integration_s", "s", "integration time of a sample in this drive", lambda p: p.before.drive.integration_s),
    Entry("ambient_k", "K", "ambient temperature of this drive", lambda p: p.before.drive.ambient_k),
    Entry("power_price", "1", "weight of power in the reward of this drive", lambda p: p.before.drive.power_price),
    Entry("family", "code", "scene family of the frame, a place in `family_names`", lambda p: p.family_codes[p.before.drive.frame(p.before.step)]),
    Entry("frame", "1", "number of the frame in the bank", lambda p: p.before.drive.frame(p.before.step)),
    Entry("temperature_k", "K", "laser temperature after the frame", lambda p: p.after.laser.temperature_k),
    Entry("eye_power_w", "W", "running average of the optical power, after the frame", lambda p: p.after.laser.eye_power_w),
    Entry("shots", "1", "samples taken; 0 without laser", lambda p: p.outcome.shots, 0),
    Entry("asked", "1", "samples asked for; a sensor that protects itself takes fewer where they could trip the laser", lambda p: p.outcome.asked, 0),
    Entry("duty", "1", "share of the frame in which the laser was on", lambda p: p.outcome.cost.duty, 0.0),
    Entry("energy_j", "J", "energy of the frame, the sum of its parts", lambda p: p.outcome.cost.energy_j, 0.0),
    Entry("laser_energy_j", "J", "electrical energy of the laser", lambda p: p.outcome.cost.laser_energy_j, 0.0),
    Entry("driver_energy_j", "J", "of the modulation driver", lambda p: p.outcome.cost.driver_energy_j, 0.0),
    Entry("readout_energy_j", "J", "of the readouts, that of the gray image too", lambda p: p.outcome.cost.readout_energy_j, 0.0),
    Entry("static_energy_j", "J", "of the imager standing by", lambda p: p.outcome.cost.static_energy_j, 0.0),
    Entry("network_energy_j", "J", "of network compute", lambda p: p.outcome.cost.network_energy_j, 0.0),
    Entry("power_w", "W", "`energy_j` over the frame period", lambda p: p.outcome.cost.energy_j / p.problem.frame_period_s, 0.0),
    Entry("life_used_h", "h", "what the frame took of the laser's rated life", lambda p: p.outcome.cost.life_used_h, 0.0),
    Entry("depth_mae_m", "m", "mean absolute error of the valid scored pixels", lambda p: p.outcome.score.depth_mae_m, 0.0),
    Entry("depth_rmse_m", "m", "root of the mean square error of the valid scored pixels", lambda p: p.outcome.score.depth_rmse_m, 0.0),
    Entry("wrap_accuracy", "1", "share of the scored pixels that is valid and in the right wrap", lambda p: p.outcome.score.wrap_accuracy, 0.0),
    Entry("valid_share", "1", "share of the scored pixels that is valid", lambda p: p.outcome.score.valid_share, 0.0),
    Entry("within_0p1m", "1", "share of the scored pixels that is valid and errs by less than 0.1 m", lambda p: p.outcome.score.within_0p1m, 0.0),
    Entry("tripped", "bool", "the laser was off", lambda p: p.outcome.tripped, False),
    Entry("cost", "1", "constraint violation: 1 without laser or above the cap for eyes, else 0", lambda p: violated(p).double(), 0.0),
)
"""All plain numbers of `info`; `reward_terms` and `vector_reward` stand beside them."""
# fmt: on
INFO_KEYS = (*(entry.name for entry in INFO_ENTRIES), "reward_terms", "vector_reward")


def family_names(bank: Bank) -> tuple[str, ...]:
    """Names of the scene families by their code in `info["family"]`.

    The families that worlds are drawn of have the same code in every bank; after them come those
    that this bank alone has, such as that of one's own scenes.
    """
    drawn = get_args(Family)
    return (*drawn, *sorted({clip.family for clip in bank.clips} - set(drawn)))


def family_codes(bank: Bank) -> Tensor:
    """Code of the family of each of the bank's frames, int64 [N]."""
    names, codes = family_names(bank), torch.empty(len(bank), dtype=torch.int64)
    for clip in bank.clips:
        codes[clip.start : clip.start + clip.frames] = names.index(clip.family)
    return codes


def info_columns(
    problem: Problem,
    family_codes: Tensor,
    before: State,
    after: State | None = None,
    outcome: Outcome | None = None,
) -> Columns:
    """Infos of a batch of drives: after a frame, or without `outcome` of their start.

    `vector_reward` holds the unweighted `reward_terms` in the order of `TERMS`.
    """
    played = Played(problem, family_codes, before, after or before, outcome)
    batch = len(before.step)
    columns: Columns = {}
    for entry in INFO_ENTRIES:
        if outcome is None and entry.at_start is not None:
            columns[entry.name] = np.full(batch, entry.at_start)
        else:
            # A copy, since what the state holds must not be written by whoever reads an info.
            columns[entry.name] = entry.value(played).numpy().copy()
    nothing = torch.zeros(batch, dtype=torch.float64)
    terms = [nothing if outcome is None else outcome.terms[name] for name in TERMS]
    columns["reward_terms"] = {
        name: term.numpy().copy() for name, term in zip(TERMS, terms, strict=True)
    }
    columns["vector_reward"] = torch.stack(terms, dim=1).to(torch.float32).numpy()
    return columns


def info_of(columns: Columns, row: int) -> dict[str, Any]:
    """Info of one of the drives, plain numbers."""
    info: dict[str, Any] = {}
    for name, values in columns.items():
        if isinstance(values, Mapping):
            info[name] = info_of(dict(values), row)
        else:
            info[name] = values[row].item() if values.ndim == 1 else values[row].copy()
    return info


def vector_info(columns: Columns, rows: np.ndarray, num_envs: int) -> dict[str, Any]:
    """Infos of the drives `rows` as gymnasium has them: with `_key`, which rows each key is of."""
    told: dict[str, Any] = {}
    whole = len(rows) == num_envs and bool((rows[1:] > rows[:-1]).all())
    for name, values in columns.items():
        if isinstance(values, Mapping):
            told[name] = vector_info(dict(values), rows, num_envs)
        elif whole:
            # Nothing to put in order; most steps play all drives.
            told[name] = values
        else:
            told[name] = np.zeros((num_envs, *values.shape[1:]), values.dtype)
            told[name][rows] = values
        told[f"_{name}"] = np.full(num_envs, whole)
        if not whole:
            told[f"_{name}"][rows] = True
    return told


def rows_of(columns: Columns, rows: np.ndarray) -> Columns:
    """Infos of some of the drives."""
    return {
        name: rows_of(values, rows) if isinstance(values, dict) else values[rows]
        for name, values in columns.items()
    }


def merged_columns(parts: list[tuple[np.ndarray, Columns]]) -> tuple[np.ndarray, Columns]:
    """Rows and infos of drives that were told of in parts."""
    parts = [part for part in parts if len(part[0])]
    if len(parts) == 1:
        return parts[0]

    def joined(each: list[Columns]) -> Columns:
        return {
            name: joined([one[name] for one in each])
            if isinstance(values, dict)
            else np.concatenate([one[name] for one in each])
            for name, values in each[0].items()
        }

    return np.concatenate([rows for rows, _ in parts]), joined([columns for _, columns in parts])
