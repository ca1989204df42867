"""Commands on the recordings of described cameras, `configs/camera/`."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import DONE, Command, add_json, write_numbers
from shotenv.config import ConfigError, find_config, read_config
from unwrap.support import progress, say

if TYPE_CHECKING:
    from unwrap.cameras import CameraRecording, Labelling
    from unwrap.cameras.files import CameraDescription
    from unwrap.signal import SensorDescription

SIMULATED = Path("simulated")
"""In place of a file of wiggle tables: those of the simulated sensor."""


def describe_arguments(parser: ArgumentParser) -> None:
    """Which recording of which camera, and what is known of its scene."""
    add_recording(parser)
    parser.add_argument("--camera", required=True, help="name or path of a camera's description")
    parser.add_argument(
        "--known-distance",
        type=float,
        metavar="M",
        help="radial distance of what a pixel sees, m: shows which orders of the samples fit",
    )
    parser.add_argument(
        "--at", metavar="ROW,COLUMN", help="that pixel; that in the middle of the image without"
    )
    add_json(parser)


def describe(arguments: Namespace) -> int:
    """Say what is in a recording, what it lacks, and how its samples may be ordered."""
    from unwrap.cameras import fitting, open_camera_recording, summary_of

    known_m = arguments.known_distance
    if arguments.at is not None and known_m is None:
        raise ConfigError("at is given without known_distance; expected both")
    camera, _ = read_camera(arguments.camera)
    recording = open_camera_recording(arguments.input, camera, gray=arguments.gray)
    place = _place(arguments.at, recording)
    summary, lines, oddities = summary_of(recording)
    print("\n".join(lines))
    for sentence in oddities:
        print(f"odd: {sentence}")
    found: dict[str, Any] = {"camera": camera.name, **summary.numbers(), "odd": oddities}
    if known_m is not None:
        ways = fitting(recording.pieces(), camera, known_m, place)
        print("\n".join(labelling_lines(ways, known_m, place)))
        found["labellings"] = [vars(way) for way in ways]
    write_numbers(arguments, found)
    return DONE


def labelling_lines(ways: list[Labelling], known_m: float, at: tuple[int, int]) -> list[str]:
    """Which labellings fit a known distance, one a line, and what follows from it."""
    lines = [f"{known_m:g} m at row {at[0]}, column {at[1]}:"]
    shown = [way for way in ways if way.fits or way.described]
    for way in sorted(shown, key=lambda way: (not way.fits, way.phase_deg)):
        off = f"{way.off_m:+.3f} m off, noise {way.noise_m:.3f} m"
        verdict = "fits" if way.fits else "does not fit"
        if not way.consistent:
            verdict += ", and opposite samples do not cancel"
        order = ", ".join(f"{phase:g}" for phase in way.phase_deg)
        own = " (as described)" if way.described else ""
        lines.append(
            f"  phase_deg [{order}]{own}: {way.distance_m:.3f} m at {way.frequency_hz / 1e6:g} "
            f"MHz, {off}: {verdict}"
        )
    fits = len({way.phase_deg for way in ways if way.fits})
    if fits == 0:
        lines.append(
            "none fits: is the distance right, radial, and the frequency that of the recording?"
        )
    elif fits > 1:
        lines.append(
            f"{fits} orders fit; one distance does not tell them apart: try another, which is no "
            "multiple of an eighth of the unambiguous range away"
        )
    else:
        lines.append("one order fits")
    return lines


def add_recording(parser: ArgumentParser) -> None:
    """A recording and its gray images."""
    parser.add_argument("input", type=Path, help="file or folder of the recording")
    parser.add_argument(
        "--gray", type=Path, metavar="FILE", help="gray images, where the recording has none"
    )


def read_camera(name: str) -> tuple[CameraDescription, Path]:
    """A camera's description by name or path, and the folder of its file.

    Raises
    ------
    ConfigError
        There is none, or it is of no use; the message names the field.
    """
    from unwrap.cameras.files import CameraDescription

    path = find_config("camera", name)
    return read_config(CameraDescription, path), path.parent


def correct_camera_files(arguments: Namespace) -> int:
    """Correct the recording of a described camera; where anything is refused, nothing is written.

    Long recordings are read piece by piece, twice: once to find out what is wrong with them.
    """
    from unwrap.cameras import (
        camera_for,
        correct_frames,
        dropped_frames,
        open_camera_recording,
        sensor_of,
    )
    from unwrap.networks import load_unwrapper
    from unwrap.recordings import frequency_warning, refuse_overwriting, write_frames

    camera, folder = read_camera(arguments.camera)
    recording = open_camera_recording(arguments.input, camera, gray=arguments.gray)
    first = next(recording.pieces())
    if not arguments.overwrite:
        names = recording.names
        refuse_overwriting(names, arguments.out, points=arguments.points, mcap=arguments.mcap)
    unwrapper = unwrapper_of(arguments)
    sensor = sensor_of(camera, first.frequencies_hz, unwrapped=unwrapper is not None)
    if arguments.wiggle == SIMULATED:
        sensor = with_simulated_wiggle(sensor, arguments.sensor)
    settings = camera_for(
        camera,
        sensor,
        recording.size,
        folder,
        unwrapper=unwrapper,
        merge=arguments.merge,
        eight=arguments.eight,
        wiggle=None if arguments.wiggle == SIMULATED else arguments.wiggle,
        noise_lsb=arguments.noise_lsb,
    )
    network = None
    # Three frequencies need none.
    if unwrapper is not None and first.gray is not None and len(first.frequencies_hz) < 3:
        network = load_unwrapper(unwrapper)
        if (warning := frequency_warning(network, sensor, recording.size)) is not None:
            say(f"warning: {warning}")
    where, found = str(arguments.input), None
    times: list[float] = []
    if len(first) < len(recording.names):
        for _ in recording.pieces():
            pass  # What is refused is refused before anything is written.
    told = progress(len(recording.names), "correcting", "frame")
    with depth_log(arguments) as log, told as bar:
        for piece in recording.pieces():
            frames = correct_frames(
                piece, camera, settings, where, offset=arguments.offset, network=network
            )
            written = write_frames(
                frames,
                settings,
                arguments.out,
                points=arguments.points,
                log=log,
                times_s=piece.timestamp_s,
                tick=bar.update,
            )
            found = written if found is None else _joined(found, written)
            times += piece.timestamp_s or ()
    assert found is not None  # No recording is without frames.
    tell_of_frames(found)
    # Each frame has its depth all the same: who follows them over time must know.
    for sentence in dropped_frames(times, recording.names):
        say(f"warning: {where}: {sentence}")
    write_numbers(arguments, found)
    return DONE


def depth_log(arguments: Namespace) -> AbstractContextManager[Any]:
    """The file that `--mcap` names, open; or None."""
    from unwrap.ros import mcap_log

    if arguments.mcap is None:
        return nullcontext()
    return mcap_log(arguments.mcap, arguments.frame_rate_hz)


def unwrapper_of(arguments: Namespace) -> str | None:
    """The network that `--unwrapper` names; none where it says so."""
    return None if arguments.unwrapper == "none" else arguments.unwrapper


def with_simulated_wiggle(sensor: SensorDescription, name: str) -> SensorDescription:
    """`sensor` with the tables of a simulated one, which was asked for.

    Raises
    ------
    ValueError
        The simulated one has other frequencies.
    """
    from shotenv.config import SensorConfig
    from shotenv.sensor import description_of

    simulated = description_of(read_config(SensorConfig, find_config("sensor", name)))
    # Of one frequency f2 is f1, and its table is not asked for.
    same = simulated.f1_hz == sensor.f1_hz and sensor.f2_hz in (simulated.f2_hz, sensor.f1_hz)
    if not same:
        raise ValueError(
            f"wiggle is simulated and sensor {name} has tables at {simulated.f1_hz / 1e6:g} and "
            f"{simulated.f2_hz / 1e6:g} MHz; expected {sensor.f1_hz / 1e6:g} MHz"
        )
    return replace(sensor, wiggle=simulated.wiggle)


def tell_of_frames(found: dict[str, Any]) -> None:
    """One line on each frame that was written."""
    for frame in found["frames"]:
        told = f"{100 * frame['valid_share']:.1f} % valid, median {frame['median_m']:.3f} m"
        if frame["pixels_beyond_png"]:
            told += f", {frame['pixels_beyond_png']} beyond 65.535 m in the PNG"
        told += f", noise {frame['noise_lsb']:.2f} LSB ({frame['noise_source']})"
        print(f"{frame['folder']}: {told}")


def _joined(found: dict[str, Any], more: dict[str, Any]) -> dict[str, Any]:
    return {**found, "frames": found["frames"] + more["frames"]}


def _place(at: str | None, recording: CameraRecording) -> tuple[int, int]:
    """Row and column that `--at` names."""
    if at is None:
        return recording.size[0] // 2, recording.size[1] // 2
    if (found := re.fullmatch(r"(\d+),(\d+)", at)) is None:
        raise ConfigError(f"at is {at!r}; expected ROW,COLUMN, such as 120,160")
    return int(found[1]), int(found[2])


DESCRIBE = Command(
    "camera describe",
    "say what is in a camera's recording, what it lacks, and which order of samples fits",
    describe_arguments,
    describe,
)
