"""The command that measures how much there is to win in the decision problem."""

from __future__ import annotations

from jsonargparse import Namespace

from agents.cli.command import DONE, Command, write_numbers
from agents.cli.experiment import (
    add_experiment,
    experiment_of,
    play_on_one_thread,
    prepare_bank,
)
from unwrap.support import progress


def measure_configuration(arguments: Namespace) -> int:
    """Measure the decision problem."""
    from agents.evaluation import check_solvable, drive_seeds, measure_problem, print_problem
    from agents.optimum import tabulate
    from shotenv.decision import open_problem

    config = experiment_of(arguments)
    check_solvable(config.env.laser)  # before minutes are spent
    prepare_bank(config.env)
    play_on_one_thread()
    counts = {"validation": config.study.tuning_drives, config.study.split: config.study.drives}
    frames = sum(counts.values()) * config.env.frames_per_drive
    problems = {
        split: open_problem(config.env.model_copy(update={"split": split})) for split in counts
    }
    with progress(frames, "playing every action in every frame", "frame") as bar:
        validation, test = (
            tabulate(problems[split], drive_seeds(config.study, count), tick=bar.update)
            for split, count in counts.items()
        )
    # Policies are tuned on validation clips and judged on those of the study's split.
    found = measure_problem(validation, test, config.env.reward, config.study)
    print_problem(found, config)
    write_numbers(arguments, found)
    return DONE


COMMANDS = (
    Command(
        "problem",
        "measure how much there is to win in the decision problem",
        add_experiment,
        measure_configuration,
    ),
)
