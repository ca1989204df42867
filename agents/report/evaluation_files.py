"""An evaluation, written as the files that the page is made of."""

from __future__ import annotations

from pathlib import Path

from agents.config import DemoConfig
from agents.evaluation import Evaluation, PlayedDrives, drive_rows, timeline
from agents.report.results import (
    DRIVES,
    FRAMES,
    RESULTS,
    TIMELINE,
    TODAY,
    write_drives,
    write_strip,
)
from agents.report.strip import take_strip
from shotenv.decision import open_problem
from unwrap.support import write_json


def write_evaluation(evaluation: Evaluation, config: DemoConfig, folder: Path) -> None:
    """Write `results.json`, `drives.csv`, `timeline.json` and `frames.npz` into `folder`.

    A thinned bank has no images: of it there is no `frames.npz`. `results.json` comes last, so
    that a folder that has it has everything.
    """
    results, played = evaluation.results, evaluation.played
    scheduler = played[results["scheduler"]]
    compared = {name: played[name] for name in (results["scheduler"], TODAY)}
    laser, rate_hz = config.env.laser, config.env.frame_rate_hz
    # One drive, by a rule and not by hand: the page shows no drive that someone picked.
    shown = drive_to_show(scheduler)
    write_json(folder / TIMELINE, timeline(compared, shown, rate_hz, laser.trip_k, laser.release_k))
    write_drives(folder / DRIVES, drive_rows(played))
    problem = open_problem(config.env.model_copy(update={"split": config.study.split}))
    if results["every"] == 1:
        write_strip(folder / FRAMES, take_strip(problem, scheduler))
    write_json(folder / RESULTS, results)


def drive_to_show(played: PlayedDrives) -> int:
    """The drive with the most scene families, and among those the hottest."""
    families = [len(set(row)) for row in played.family.tolist()]
    hottest_k = played.temperature_k.max(axis=1).tolist()
    return max(range(len(families)), key=lambda i: (families[i], hottest_k[i]))
