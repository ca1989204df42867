"""Frames to look at: images of every scene family as the scheduler took them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor

from agents.evaluation import PlayedDrives
from agents.optimum import drive_of
from agents.report.results import Strip
from shotenv.decision import Drive, Problem, acquire_depth
from shotenv.laser import emitted_power_w
from unwrap.signal import Shots, unambiguous_range_m

FRAMES_PER_FAMILY = 8


def take_strip(problem: Problem, played: PlayedDrives) -> Strip:
    """A run of frames of each scene family in `played`, taken again with the same noise."""
    chosen = list(_runs(played))
    drives = {i: drive_of(problem, int(played.seeds[i])) for i, _ in chosen}
    images = [
        _images(
            problem,
            drives[i],
            frame,
            int(played.shots[i, frame]),
            _power_w(problem, drives[i], played, i, frame),
        )
        for i, frame in chosen
    ]
    where = tuple(np.array(chosen).T)
    return Strip(
        **{name: np.stack([one[name] for one in images]) for name in images[0]},
        shots=played.shots[where],
        frame=where[1],
        depth_mae_m=played.depth_mae_m[where],
        family=played.family[where],
        drive=played.seeds[where[0]],
        unambiguous_m=np.asarray(unambiguous_range_m(problem.config.sensor.f1_hz)),
        max_range_m=np.asarray(problem.config.sensor.max_range_m),
    )


def _runs(played: PlayedDrives) -> Iterator[tuple[int, int]]:
    """(drive, frame) of some consecutive frames of each family: a run with many choices of shots.

    A run in which the scheduler changes its mind shows more than one in which it does not.
    """
    for family in np.unique(played.family).tolist():
        starts = np.argwhere(played.family == family)
        runs = [_run(played, int(i), int(frame), family) for i, frame in starts]
        yield from max(runs, key=lambda run: (len(run), len({played.shots[at] for at in run})))


def _run(played: PlayedDrives, drive: int, start: int, family: str) -> list[tuple[int, int]]:
    end = start
    while end < min(start + FRAMES_PER_FAMILY, played.shots.shape[1]):
        if played.family[drive, end] != family or played.shots[drive, end] == 0:
            break
        end += 1
    return [(drive, frame) for frame in range(start, end)]


def _power_w(problem: Problem, drive: Drive, played: PlayedDrives, row: int, frame: int) -> Tensor:
    """The laser's power in a frame, after derating."""
    told_k = torch.tensor(played.temperature_k[[row], max(frame - 1, 0)])
    start_k = told_k if frame else drive.start_k
    return emitted_power_w(drive.laser_power_w, start_k, problem.config.laser)


def _images(
    problem: Problem, drive: Drive, frame: int, shots: int, power_w: Tensor
) -> dict[str, np.ndarray]:
    step = torch.tensor([frame])
    made = acquire_depth(problem, drive, step, Shots(shots), power_w)
    return {
        "gray_lsb": problem.bank.gray(drive.frame(step))[0].numpy(),
        "wrapped_m": _half(made.depth.wrapped_m[0]),
        "corrected_m": _half(made.depth.distance_m[0]),
        "truth_m": _half(made.truth_m[0]),
        "valid": made.depth.valid[0].numpy(),
    }


def _half(image: Tensor) -> np.ndarray:
    """float16 keeps better than 1 % of a metre where it is scored, at half the size."""
    return image.to(torch.float16).numpy()
