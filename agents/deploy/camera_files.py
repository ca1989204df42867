"""Everything that a camera needs of a trained scheduler, checked first and then written."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from agents.deploy.agreement import CheckCases, different_actions, random_cases
from agents.deploy.c_check import run_self_test
from agents.deploy.c_source import HEADER, SOURCE, VECTORS, c_header, c_source, c_vectors
from agents.deploy.onnx_policy import check_onnx, onnx_metadata, onnx_policy
from agents.policies import (
    NetworkPolicy,
    Scheduler,
    linear_layers,
    weights_in_blocks,
    widths_of,
)
from unwrap.support import write_bytes, write_text

ONNX: Final = "policy.onnx"
CHECKED, TOLD_VECTORS = 65_536, 64
"""Observations that the ONNX file is checked with, and test vectors of the C files."""


@dataclass(frozen=True)
class Cost:
    """What a choice costs a camera.

    Attributes
    ----------
    weight_bytes : int
        Constant float32 weights and biases.
    working_bytes : int
        Hidden layers and scores on the stack.
    multiply_accumulates : int
    activations : int
        Values of tanh or relu.
    """

    weight_bytes: int
    working_bytes: int
    multiply_accumulates: int
    activations: int


def cost_of_choice(policy: NetworkPolicy) -> Cost:
    """Cost of one choice of `policy`."""
    widths = np.array(widths_of(policy.network))
    # Of a block-diagonal layer the blocks alone are written.
    products = sum(weights_in_blocks(layer).numel() for layer in linear_layers(policy.network))
    hidden = int(widths[1:-1].sum())
    values = products + int(widths[1:].sum())
    return Cost(4 * values, 4 * (hidden + int(widths[-1])), products, hidden)


def export_policy(policy: Scheduler, out: Path, *, onnx: bool = True) -> dict[str, Any]:
    """Write `policy` as C files and, if asked for, ONNX into `out`; nothing where a check fails.

    Returns
    -------
    dict
        Names of the files, the cost of a choice, and what the checks found.

    Raises
    ------
    ValueError
        A file chooses otherwise than torch, or `policy` has a memory of its own.
    OSError
        `out` cannot be written.
    """
    if not isinstance(policy, NetworkPolicy):
        raise ValueError(
            f"the scheduler is a {type(policy).__name__}, which remembers what is in no "
            "observation; expected a network of the features, as ppo, dqn, qrdqn and regression "
            "train them"
        )
    cases = random_cases(policy, CHECKED)
    files = {
        HEADER: c_header(policy),
        SOURCE: c_source(policy),
        VECTORS: c_vectors(clear_cases(policy, cases)),
    }
    microseconds = run_self_test(files)
    found: dict[str, Any] = {
        "files": list(files),
        "cost": asdict(cost_of_choice(policy)) | {"microseconds": microseconds},
        "checked_observations": CHECKED,
    }
    if onnx:
        content = onnx_policy(policy, onnx_metadata(policy))
        found["onnx_largest_difference"] = check_onnx(content, cases)
        found["files"].append(ONNX)
        write_bytes(out / ONNX, content)
    for name, text in files.items():
        write_text(out / name, text)
    return found


def clear_cases(policy: NetworkPolicy, cases: CheckCases) -> CheckCases:
    """Test vectors: the first cases in which no rounding changes the action."""
    # One that is clear differs from torch's where another action is put in its place.
    kept = [
        row
        for row in range(min(len(cases.actions), 4 * TOLD_VECTORS))
        if different_actions(part := rows_of(cases, [row]), (part.actions + 1) % 3)
    ]
    return rows_of(cases, kept[:TOLD_VECTORS])


def rows_of(cases: CheckCases, rows: list[int]) -> CheckCases:
    """Some of the cases."""
    return CheckCases(
        cases.observations[rows], cases.allowed[rows], cases.scores[rows], cases.actions[rows]
    )
