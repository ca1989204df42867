"""The command that measures how much there is to win in the decision problem."""

from __future__ import annotations

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import (
    DONE,
    Command,
    add_experiment,
    experiment_of,
    play_on_one_thread,
    prepare_bank,
    write_numbers,
)
from unwrap.support import progress


def add_problem(parser: ArgumentParser) -> None:
    """The experiment, and which goals it is held to."""
    add_experiment(parser)
    parser.add_argument(
        "--goals",
        choices=["default", "hot"],
        default="default",
        help="goals of the default problem, or of one in which heat binds",
    )


def measure_configuration(arguments: Namespace) -> int:
    """Measure the decision problem."""
    from agents.evaluation import (
        check_solvable,
        drive_seeds,
        judged,
        measure_problem,
        print_problem,
    )
    from agents.optimum import tabulate
    from shotenv.decision import open_problem

    config = experiment_of(arguments)
    check_solvable(config.env.laser)  # before minutes are spent
    prepare_bank(config.env)
    play_on_one_thread()
    counts = {
        "train": config.study.drives,
        "validation": config.study.tuning_drives,
        config.study.split: config.study.drives,
    }
    frames = sum(counts.values()) * config.env.frames_per_drive
    problems = {
        split: open_problem(config.env.model_copy(update={"split": split})) for split in counts
    }
    with progress(frames, "playing every action in every frame", "frame") as bar:
        training, validation, test = (
            tabulate(problems[split], drive_seeds(config.study, count), tick=bar.update)
            for split, count in counts.items()
        )
    # Policies are tuned on validation clips and judged on those of the study's split.
    measured = measure_problem(training, validation, test, config.study)
    found = judged(measured, heat_binds=arguments.goals == "hot")
    print_problem(found, config)
    write_numbers(arguments, found)
    return DONE


COMMANDS = (
    Command(
        "problem",
        "measure how much there is to win in the decision problem",
        add_problem,
        measure_configuration,
    ),
)
