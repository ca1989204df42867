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

FRAMES_PER_FAMILY = 8  # assumed: enough to see the scene move, in a page of some MB


def take_strip(
    problem: Problem, played: PlayedDrives, optimum: PlayedDrives | None = None
) -> Strip:
    """A run of frames of each scene family in `played`, taken again with the same noise.

    `optimum` is of the drives of `runs_to_show`, among others or not; None where it is not known.
    """
    chosen = list(runs_to_show(played))
    drives = {row: drive_of(problem, int(played.seeds[row])) for row, _ in chosen}
    images = [taken_again(problem, drives[row], played, row, frame) for row, frame in chosen]
    where = drives_shown, frames_shown = tuple(np.array(chosen).T)
    best_shots, best_energy_j = np.empty(0, np.int64), np.empty(0)
    if optimum is not None:
        rows = [optimum.seeds.tolist().index(seed) for seed in played.seeds[drives_shown]]
        best_shots = optimum.shots[rows, frames_shown]
        best_energy_j = optimum.laser_energy_j.cumsum(axis=1)[rows, frames_shown]
    return Strip(
        **{name: np.stack([one[name] for one in images]) for name in images[0]},
        shots=played.shots[where],
        frame=frames_shown,
        depth_mae_m=played.depth_mae_m[where],
        temperature_k=played.temperature_k[where],
        laser_energy_j=played.laser_energy_j.cumsum(axis=1)[where],
        optimum_shots=best_shots,
        optimum_energy_j=best_energy_j,
        family=played.family[where],
        drive=played.seeds[drives_shown],
        unambiguous_m=np.asarray(unambiguous_range_m(problem.config.sensor.f1_hz)),
        max_range_m=np.asarray(problem.config.sensor.max_range_m),
    )


def taken_again(
    problem: Problem, drive: Drive, played: PlayedDrives, row: int, frame: int
) -> dict[str, np.ndarray]:
    """Images of a frame of `drive`, which is row `row` of `played`, by the names of a `Strip`.

    [H, W] each; of a frame without laser there is the gray image alone.
    """
    step, shots = torch.tensor([frame]), int(played.shots[row, frame])
    gray = {"gray_lsb": problem.bank.gray(drive.frame(step))[0].numpy()}
    if not shots:
        return gray
    # A derated laser's power follows its temperature before the frame: `temperature_k` is that
    # after it, so the one of the frame before counts.
    before_k = torch.tensor(played.temperature_k[[row], frame - 1]) if frame else drive.start_k
    power_w = emitted_power_w(drive.laser_power_w, before_k, problem.config.laser)
    made = acquire_depth(problem, drive, step, Shots(shots), power_w)
    return gray | {
        "wrapped_m": _half(made.depth.wrapped_m[0]),
        "corrected_m": _half(made.depth.distance_m[0]),
        "truth_m": _half(made.truth_m[0]),
        "valid": made.depth.valid[0].numpy(),
    }


def runs_to_show(played: PlayedDrives) -> Iterator[tuple[int, int]]:
    """(drive, frame) of up to `FRAMES_PER_FAMILY` consecutive frames of each family.

    The longest run is taken, and among those the one with most different shots: a run in which the
    scheduler changes its mind shows more than one in which it does not.
    """
    for family in np.unique(played.family).tolist():
        shown = (played.family == family) & (played.shots > 0)
        runs = []
        for drive, start in np.argwhere(played.family == family).tolist():
            ahead = shown[drive, start : start + FRAMES_PER_FAMILY]
            length = len(ahead) if ahead.all() else int(np.argmin(ahead))  # to the first False
            runs.append([(drive, frame) for frame in range(start, start + length)])
        yield from max(runs, key=lambda run: (len(run), len({played.shots[at] for at in run})))


def _half(image: Tensor) -> np.ndarray:
    """A map of metres as float16: steps of at most 16 mm up to 32 m, at half the size."""
    return image.to(torch.float16).numpy()
