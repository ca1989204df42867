"""How well each way of unwrapping does on the sensor, over the frames of a bank's split."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from itertools import islice
from typing import Any, Final

import torch
from torch import Tensor

from shotenv.bank import Clip, require_full
from shotenv.decision import Problem, acquire_depth, draw_drive, noise_of
from unwrap.depth import Scores, evaluate, mean_scores
from unwrap.signal import Shots

SHOWN: Final = ("wrap_accuracy", "valid_share", "mae_m", "rmse_m", "abs_rel", "p95_m")


def measure_unwrapping(
    problem: Problem, *, tick: Callable[[int], object] = lambda frames: None
) -> dict[str, Any]:
    """Scores of every method on every frame of the problem's split, in all and per family.

    Each clip has its own laser power, integration time and noise, drawn as for a drive with the
    clip's seed. `tick` is told the number of frames after each clip.
    """
    require_full(problem.bank, "the comparison of unwrapping methods")
    scores: dict[str, list[tuple[int, Scores]]] = {}
    for clip in problem.clips:
        found = _clip_scores(problem, clip)
        for key in ("all", clip.family):
            scores.setdefault(key, []).extend((1, one) for one in found)
        tick(clip.frames)
    means = {key: mean_scores(several) for key, several in scores.items()}
    frames = sum(clip.frames for clip in problem.clips)
    return {"frames": frames, "methods": means.pop("all"), "families": means}


def _clip_scores(problem: Problem, clip: Clip) -> list[Scores]:
    bank = problem.bank
    # The clips that this drive would play are drawn in vain: its frames are replaced by the clip's.
    drive = draw_drive(clip.seed, problem.config, problem.clips, bank.height, bank.width)
    frames = torch.arange(clip.start, clip.start + clip.frames)
    drive = dataclasses.replace(drive, frames=frames.unsqueeze(0))
    scores = []
    for place in range(clip.frames):
        step = torch.tensor([place])
        noise = list(islice(noise_of(drive, step, bank.height, bank.width), Shots.EIGHT))
        made = {shots: acquire_depth(problem, drive, step, shots, noise=noise) for shots in Shots}
        one = made[Shots.EIGHT]
        # One prediction serves all, unless the network looks at the samples of each acquisition.
        predicted_m: Tensor | dict[Shots, Tensor] = one.predicted_m
        if problem.fusion is not None:
            predicted_m = {shots: acquisition.predicted_m for shots, acquisition in made.items()}
        scores.append(
            evaluate(
                {shots: acquisition.raw for shots, acquisition in made.items()},
                predicted_m,
                one.truth_m,
                one.scored,
                problem.description,
                offset_lsb=drive.offsets.calibrated_lsb,
                noise_lsb={shots: acquisition.noise_lsb for shots, acquisition in made.items()},
                shift_m=drive.drift_m,
            )
        )
    return scores


def print_unwrapping(found: dict[str, Any]) -> None:
    """The scores as a table."""
    print(f"{found['frames']} frames, means over frames, pixels with signal within the range\n")
    print(f"{'':18}" + "".join(f"{name:>15}" for name in SHOWN))
    for method, scores in found["methods"].items():
        cells = (f"{scores[name]:15.3f}" if name in scores else f"{'':15}" for name in SHOWN)
        print(f"{method:18}" + "".join(cells))
