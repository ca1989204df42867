"""Commands that train, measure, compare and export unwrapping networks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import (
    DONE,
    Command,
    add_config,
    add_executor,
    add_json,
    add_out,
    add_sensor_and_merge,
    execution_of,
    section_of,
    write_numbers,
)
from unwrap.support import progress, say


def train_arguments(parser: ArgumentParser) -> None:
    """Configuration of the training, and where the weights go."""
    from unwrap.training import TrainConfig

    # Not `add_config`: there is no file of defaults, which are the fields' own.
    parser.add_argument("--config", action="config", help="YAML file over the defaults")
    parser.add_class_arguments(TrainConfig, None, sub_configs=True)
    parser.add_argument(
        "--devices",
        type=int,
        default=1,
        metavar="N",
        help="GPUs of this machine that share each batch; processes where there is none",
    )
    parser.add_argument(
        "--nodes", type=int, default=1, metavar="M", help="machines that do so (docs/scale.md)"
    )
    add_out(parser, "runs/unwrap", "folder of the weights and the checkpoint")


def train_network(arguments: Namespace) -> int:
    """Train an unwrapping network."""
    from shotenv.dataset import for_sensor, gray_warning, sources
    from unwrap.training import TrainConfig, is_first_process, train

    config = for_sensor(section_of(TrainConfig, arguments))
    splits = sources(config)  # What does not go together is told at once.
    # What a launcher started on many machines speaks with one voice.
    talks = is_first_process()
    if talks and (warning := gray_warning(config)) is not None:
        say(f"warning: {warning}")
    if talks:
        print(
            f"{config.network} for {config.f1_hz / 1e6:g} MHz: wraps of "
            f"{config.settings.unambiguous_m:.3g} m, up to {config.max_range_m:g} m"
        )
    devices, nodes = arguments.devices, arguments.nodes
    path = train(config, splits, arguments.out, devices=devices, nodes=nodes)
    if talks:
        print(f"The network is in {path}")
    return DONE


def evaluate_arguments(parser: ArgumentParser) -> None:
    """Which network on which frames."""
    parser.add_argument("unwrapper", help="name or path of a network")
    parser.add_argument("--bank", default="starter", help="name or path of a bank")
    parser.add_argument("--split", default="test", help="train, validation, test, shift or all")
    add_json(parser)


def evaluate_network(arguments: Namespace) -> int:
    """Measure an unwrapping network."""
    from shotenv.bank import open_bank
    from shotenv.dataset import bench_config, measure_unwrapping, print_unwrapping
    from shotenv.decision import open_problem
    from unwrap import load_unwrapper

    load_unwrapper(arguments.unwrapper)  # refused before a bank is rendered for it
    chosen = {name: arguments[name] for name in ("bank", "unwrapper", "split")}
    # Every frame stands alone here: a bank of any frame rate will do.
    if (rendered := open_bank(arguments.bank).config) is not None:
        chosen["frame_rate_hz"] = rendered.world.frame_rate_hz
    problem = open_problem(bench_config(**chosen))
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
    add_executor(parser, "trainings", "one after the other, with ray one per core")
    add_json(parser)


def compare_methods(arguments: Namespace) -> int:
    """Train, score and show every method of the results table."""
    from shotenv.dataset import sources
    from unwrap.comparison import TableConfig, make_table

    config = section_of(TableConfig, arguments)
    rows = make_table(
        config, sources, arguments.out, arguments.page, arguments.only, **execution_of(arguments)
    )
    write_numbers(arguments, rows)
    return DONE


def export_arguments(parser: ArgumentParser) -> None:
    """Which network for which frames, what it is checked with, and the file that it goes to."""
    parser.add_argument("unwrapper", help="name or path of a network")
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.onnx")
    parser.add_argument("--height", type=int, default=240, help="pixels down")
    parser.add_argument("--width", type=int, default=320, help="pixels across")
    parser.add_argument(
        "--shots",
        type=int,
        metavar="N",
        help="samples of each frame, 2 or 4 (default), for a network that looks at them",
    )
    add_sensor_and_merge(parser)
    parser.add_argument("--int8", action="store_true", help="write FILE.int8.onnx, quantised, too")
    parser.add_argument(
        "--check-bank",
        metavar="BANK",
        help="name or path of a bank to check and calibrate with, or none: made-up images "
        "(default: starter where it is rendered, else none)",
    )
    add_json(parser)


def export_network(arguments: Namespace) -> int:
    """Write a network as ONNX; a file that disagrees with torch is not written."""
    from shotenv.config import env_config
    from shotenv.dataset import bank_export_frames, choose_check_bank
    from shotenv.sensor import description_of
    from unwrap import load_unwrapper
    from unwrap.export import (
        CALIBRATION_FRAMES,
        CHECKED_FRAMES,
        OPSET,
        CheckedExport,
        ExportFrames,
        exported_network,
        made_up_frames,
        metadata_of,
        shots_of,
    )

    config = env_config(sensor=arguments.sensor)
    sensor = description_of(config.sensor)
    unwrapper, size = load_unwrapper(arguments.unwrapper), _image_size(arguments)
    shots = shots_of(unwrapper, arguments.shots)
    network = exported_network(unwrapper, sensor, arguments.merge)
    bank = choose_check_bank(arguments.check_bank, config.sensor)

    def frames_of(split: str, count: int) -> ExportFrames:
        if bank is None:
            return made_up_frames(split, count, size, sensor, shots)
        return bank_export_frames(bank, split, count, size, config, shots)

    frames = frames_of("test", CHECKED_FRAMES)
    metadata = metadata_of(unwrapper, arguments.merge, sensor, config.sensor.name, size, shots)
    export = CheckedExport(network, frames, metadata)
    # `write` checks against torch before it writes; the quantised file is calibrated on frames of
    # training and checked on those of the test.
    found: dict[str, Any] = {"frames": frames.source, "opset": OPSET}
    found["onnx"] = export.write(arguments.out)
    _tell_of_file(found["onnx"])
    if arguments.int8:
        calibration = frames_of("train", CALIBRATION_FRAMES)
        found["int8"] = export.write_int8(arguments.out.with_suffix(".int8.onnx"), calibration)
        _tell_of_file(found["int8"])
    write_numbers(arguments, found)
    return DONE


def _image_size(arguments: Namespace) -> tuple[int, int]:
    """Height and width in pixels, checked."""
    # Assumed limits: below, the networks' coarsest maps have no pixels left; above, memory ends.
    for name in ("height", "width"):
        if not 16 <= arguments[name] <= 4096:
            raise ValueError(f"{name} is {arguments[name]}; expected 16 to 4096 pixels")
    return arguments.height, arguments.width


def _tell_of_file(found: dict[str, Any]) -> None:
    """One line on an ONNX file: its size and its share of equal and of right wraps."""
    told = f"{found['file']}: {found['bytes'] / 1e6:.1f} MB, same wrap as torch in "
    told += f"{100 * found['same_wraps']:.3f} % of the pixels"
    if found["wrap_accuracy"] is not None:
        told += (
            f"; right wrap in {100 * found['wrap_accuracy']:.2f} %, "
            f"torch {100 * found['wrap_accuracy_torch']:.2f} %"
        )
    print(told)


COMMANDS: tuple[Command, ...] = (
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
        "unwrap export",
        "write a network as ONNX and check it against torch",
        export_arguments,
        export_network,
        out_is_file=True,
    ),
)
