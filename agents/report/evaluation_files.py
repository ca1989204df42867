"""An evaluation, written as the files that the page is made of."""

from __future__ import annotations

from pathlib import Path

from agents.config import DemoConfig
from agents.evaluation import Evaluation, PlayedDrives, drive_rows, play_optimum, timeline
from agents.report.choice_maps import choice_maps
from agents.report.results import (
    CHOICES,
    DRIVES,
    FRAMES,
    OPTIMUM,
    RESULTS,
    TIMELINE,
    TODAY,
    write_drives,
    write_strip,
)
from agents.report.strip import runs_to_show, take_strip
from shotenv.decision import Problem, open_problem
from unwrap.support import progress, write_json


def write_evaluation(evaluation: Evaluation, config: DemoConfig, folder: Path) -> None:
    """Write `results.json` and the files beside it, see `agents/report/results.py`.

    A thinned bank has no images: of it there is no `frames.npz`. `results.json` comes last, so
    that a folder that has it has everything.
    """
    results, played = evaluation.results, evaluation.played
    scheduler = played[results["scheduler"]]
    compared = {name: played[name] for name in (results["scheduler"], TODAY)}
    laser, rate_hz = config.env.laser, config.env.frame_rate_hz
    problem = open_problem(config.env.model_copy(update={"split": config.study.split}))
    # One drive, by a rule and not by hand: the page shows no drive that someone picked.
    shown = drive_to_show(scheduler)
    with_images = results["every"] == 1
    pictured = {row for row, _ in runs_to_show(scheduler)} if with_images else set()
    rows = sorted({shown, *pictured})
    optimum = best_of(problem, scheduler.seeds[rows].tolist())
    if optimum is not None:
        compared[OPTIMUM] = optimum
    write_json(folder / TIMELINE, timeline(compared, shown, rate_hz, laser.trip_k, laser.release_k))
    write_drives(folder / DRIVES, drive_rows(played))
    if with_images:
        write_strip(folder / FRAMES, take_strip(problem, scheduler, optimum))
    write_json(
        folder / CHOICES, {"maps": choice_maps(evaluation.at_prices, config.env.sensor.max_range_m)}
    )
    write_json(folder / RESULTS, results)


def best_of(problem: Problem, seeds: list[int]) -> PlayedDrives | None:
    """What the optimum would have done in these drives; None where it is not known."""
    frames = len(seeds) * problem.config.frames_per_drive
    with progress(frames, "the optimum of the drives shown", "frame") as bar:
        return play_optimum(problem, seeds, tick=bar.update)


def drive_to_show(played: PlayedDrives) -> int:
    """The drive with the most scene families, and among those the hottest."""
    families = [len(set(row)) for row in played.family.tolist()]
    hottest_k = played.temperature_k.max(axis=1).tolist()
    return max(range(len(families)), key=lambda i: (families[i], hottest_k[i]))
