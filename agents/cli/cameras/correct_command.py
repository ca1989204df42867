"""The command that corrects recordings: what camera, which network, which files of depth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

from jsonargparse import ArgumentParser, Namespace

from agents.cli.cameras.camera_commands import (
    SIMULATED,
    add_recording,
    correct_camera_files,
    depth_log,
    tell_of_frames,
    unwrapper_of,
)
from agents.cli.command import (
    DONE,
    Command,
    add_json,
    add_out,
    add_sensor_and_merge,
    write_numbers,
)
from unwrap.support import progress


def correct_arguments(parser: ArgumentParser) -> None:
    """Which recording, of which camera, and where its depth goes."""
    from unwrap.depth import Eight

    add_recording(parser)
    parser.add_argument(
        "--camera",
        metavar="NAME",
        help="name or path of the camera's description; without it .npy, .npz or a folder of "
        "16-bit PNG files, in the order of docs/correct_and_export.md",
    )
    add_sensor_and_merge(parser)
    ways = ", ".join(get_args(Eight))
    parser.add_argument(
        "--eight", type=Eight, default="two_frequency", help=f"who unwraps 8 samples: {ways}"
    )
    parser.add_argument(
        "--unwrapper",
        default="tofsegnet",
        help="name or path of a network, or none: 2 and 4 samples stay wrapped",
    )
    add_out(parser, "runs/corrected", "folder of the depth")
    parser.add_argument("--offset", type=Path, metavar="FILE", help="dark-offset map (.npy), LSB")
    parser.add_argument(
        "--wiggle",
        type=Path,
        metavar="FILE",
        help="the camera's own wiggle tables, or simulated: those of --sensor (default: none)",
    )
    parser.add_argument("--noise-lsb", type=float, metavar="X", help="std of a sample, LSB")
    parser.add_argument("--fov-deg", type=float, default=60.0, help="horizontal field of view")
    add_depth_files(parser)
    add_json(parser)


def add_depth_files(parser: ArgumentParser) -> None:
    """Which files the depth is written as, beside those that are always written."""
    from unwrap.recordings import Points

    forms = ", ".join(get_args(Points))
    parser.add_argument("--points", type=Points, default="ply", help=f"format of points: {forms}")
    parser.add_argument(
        "--mcap", type=Path, metavar="FILE", help="all frames as messages of ROS 2, too"
    )
    parser.add_argument("--frame-rate-hz", type=float, default=10.0, help="of the times in --mcap")
    parser.add_argument("--overwrite", action="store_true", help="replace files that stand in DIR")


def correct_files(arguments: Namespace) -> int:
    """Correct a recording; where anything is refused, nothing is written."""
    if arguments.camera is not None:
        return correct_camera_files(arguments)
    from shotenv.config import SensorConfig, find_config, read_config
    from shotenv.sensor import description_of
    from unwrap.recordings import (
        camera_of,
        correct_recording,
        load_recording,
        refuse_overwriting,
        write_frames,
    )

    sensor = read_config(SensorConfig, find_config("sensor", arguments.sensor))
    description, unwrapper = description_of(sensor), unwrapper_of(arguments)
    if arguments.wiggle != SIMULATED:
        # A table of a simulated sensor is none of a real one's; its own is read below.
        description = replace(description, wiggle=None)
    camera = camera_of(
        description,
        bits=sensor.adc_bits,
        unwrapper=unwrapper,
        merge=arguments.merge,
        eight=arguments.eight,
        horizontal_fov_deg=arguments.fov_deg,
        wiggle=None if arguments.wiggle == SIMULATED else arguments.wiggle,
        noise_lsb=arguments.noise_lsb,
    )
    recording = load_recording(
        arguments.input,
        bits=camera.bits,
        gray=arguments.gray,
        offset=arguments.offset,
        unwrapped=unwrapper is not None,
    )
    if not arguments.overwrite:
        names = recording.names
        refuse_overwriting(names, arguments.out, points=arguments.points, mcap=arguments.mcap)
    frames = correct_recording(recording, camera)
    with depth_log(arguments) as log, progress(len(frames), "writing", "frame") as bar:
        found = write_frames(
            frames, camera, arguments.out, points=arguments.points, log=log, tick=bar.update
        )
    tell_of_frames(found)
    write_numbers(arguments, found)
    return DONE


CORRECT = Command(
    "unwrap correct",
    "correct recorded samples: depth, points, picture",
    correct_arguments,
    correct_files,
)
