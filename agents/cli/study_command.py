"""The command that plays policies x presets x training seeds, and makes the table of them."""

from __future__ import annotations

import os
from pathlib import Path

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import DONE, Command, add_out
from unwrap.support import write_json


def study_arguments(parser: ArgumentParser) -> None:
    """Which study, how many at a time, and where its results go."""
    parser.add_argument("file", type=Path, help="YAML file, such as configs/study/results.yaml")
    parser.add_argument(
        "--workers", type=int, default=os.cpu_count() or 1, help="processes, one thread each"
    )
    add_out(parser, "runs/study", "folder of the results of each job, and of results.json")


def run_study(arguments: Namespace) -> int:
    """Run the jobs that do not stand yet, and measure what they played."""
    from agents.config import StudyPlan
    from agents.study import jobs_of, make_leaderboard, run_jobs
    from shotenv.config import ConfigError, read_config

    if arguments.workers < 1:
        raise ConfigError(f"workers is {arguments.workers}; expected at least 1")
    plan = read_config(StudyPlan, arguments.file)
    jobs = jobs_of(plan)
    run_jobs(jobs, arguments.out, workers=arguments.workers)
    found = make_leaderboard(plan, jobs, arguments.out)
    write_json(arguments.out / "results.json", found)
    for preset, table in found["presets"].items():
        print(f"\n{preset}: {table['best']} errs least at half the energy")
        for name, row in table["rows"].items():
            at_half, rewarded = row["error_at_half_energy"], row["return"]
            print(f"  {name:22}{at_half['iqm']:6.2f} m  return {rewarded['iqm']:8.1f}")
    print(f"\nNumbers: {arguments.out / 'results.json'}")
    return DONE


COMMANDS = (
    Command(
        "study",
        "play policies x presets x training seeds, job by job, and rank them",
        study_arguments,
        run_study,
        resumes=True,
    ),
)
