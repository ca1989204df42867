"""Commands that train, measure, compare, use and export unwrapping networks."""

from __future__ import annotations

from pathlib import Path

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import (
    DONE,
    Command,
    add_config,
    add_json,
    add_out,
    section_of,
    write_numbers,
)
from unwrap.support import progress


def train_arguments(parser: ArgumentParser) -> None:
    """Configuration of the training, and where the weights go."""
    from unwrap.training import TrainConfig

    parser.add_argument("--config", action="config", help="YAML file over the defaults")
    parser.add_class_arguments(TrainConfig, None, sub_configs=True)
    add_out(parser, "runs/unwrap", "folder of the weights and the checkpoint")


def train_network(arguments: Namespace) -> int:
    """Train an unwrapping network."""
    from shotenv.dataset import sources
    from unwrap.training import TrainConfig, train

    config = section_of(TrainConfig, arguments)
    print(f"The network is in {train(config, sources(config), arguments.out)}")
    return DONE


def evaluate_arguments(parser: ArgumentParser) -> None:
    """Which network on which frames."""
    parser.add_argument("unwrapper", help="name or path of a network")
    parser.add_argument("--bank", default="starter", help="name or path of a bank")
    parser.add_argument("--split", default="test", help="train, validation, test, shift or all")
    add_json(parser)


def evaluate_network(arguments: Namespace) -> int:
    """Measure an unwrapping network."""
    from shotenv.config import env_config
    from shotenv.dataset import measure_unwrapping, print_unwrapping
    from shotenv.decision import open_problem
    from unwrap import load_unwrapper

    load_unwrapper(arguments.unwrapper)  # refused before a bank is rendered for it
    chosen = {name: arguments[name] for name in ("bank", "unwrapper", "split")}
    problem = open_problem(env_config(**chosen))
    frames = sum(clip.frames for clip in problem.clips)
    with progress(frames, "unwrapping", "frame") as bar:
        found = measure_unwrapping(problem, tick=bar.update)
    print_unwrapping(found)
    write_numbers(arguments, found)
    return DONE


def table_arguments(parser: ArgumentParser) -> None:
    """Which methods, how they are trained and where their networks and their page go."""
    from unwrap.comparison import TableConfig

    add_config(parser, TableConfig, "unwrap/table-small.yaml")
    parser.add_argument("--only", nargs="+", metavar="NETWORK", help="train these, score nothing")
    parser.add_argument(
        "--page", type=Path, metavar="DIR", help="folder of the page; that of --out"
    )
    add_out(parser, "runs/table", "folder of the networks")
    add_json(parser)


def compare_methods(arguments: Namespace) -> int:
    """Train, score and show every method of the results table."""
    from unwrap.comparison import TableConfig, make_table

    config = section_of(TableConfig, arguments)
    write_numbers(arguments, make_table(config, arguments.out, arguments.page, arguments.only))
    return DONE


def correct_arguments(parser: ArgumentParser) -> None:
    """Which recording, of which camera, and where its depth goes."""
    from unwrap.recordings import add_arguments

    add_arguments(parser)
    add_json(parser)


def correct_recording(arguments: Namespace) -> int:
    """Correct a recording."""
    from unwrap.recordings import correct_files

    write_numbers(arguments, correct_files(arguments))
    return DONE


def export_arguments(parser: ArgumentParser) -> None:
    """Which network, and the file that it goes to."""
    from unwrap.export import add_arguments

    add_arguments(parser)
    add_json(parser)


def export_network(arguments: Namespace) -> int:
    """Write a network as ONNX."""
    from unwrap.export import export_files

    write_numbers(arguments, export_files(arguments))
    return DONE


COMMANDS = (
    Command(
        "unwrap train",
        "train an unwrapping network on a rendered bank",
        train_arguments,
        train_network,
        resumes=True,
    ),
    Command(
        "unwrap evaluate",
        "measure an unwrapping network on a bank",
        evaluate_arguments,
        evaluate_network,
    ),
    Command(
        "unwrap table",
        "train every method of the results table and score them",
        table_arguments,
        compare_methods,
        resumes=True,
    ),
    Command(
        "unwrap correct",
        "correct recorded samples: depth, points, picture",
        correct_arguments,
        correct_recording,
    ),
    Command(
        "unwrap export",
        "write a network as ONNX and check it against torch",
        export_arguments,
        export_network,
    ),
)
