"""The command that writes simulated drives as a camera would have recorded them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import NonNegativeInt, PositiveInt

from agents.cli.cameras.camera_commands import read_camera
from agents.cli.command import (
    DONE,
    Command,
    add_config,
    add_json,
    play_on_one_thread,
    prepare_bank,
    section_of,
    write_numbers,
)
from shotenv.config import ConfigError, EnvConfig
from unwrap.support import progress

MOST_DRIVES: Final = 100_000
"""A file each."""


def record_arguments(parser: ArgumentParser) -> None:
    """Which drives, which camera, and where its recordings go."""
    parser.add_argument("--camera", required=True, help="name or path of a camera's description")
    parser.add_argument("--drives", type=PositiveInt, default=4, help="drives to record")
    parser.add_argument(
        "--seed", type=NonNegativeInt, default=0, help="reset(seed=...) of the first"
    )
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FOLDER", help="of the recordings"
    )
    add_config(parser, EnvConfig, "env/default.yaml")
    add_json(parser)


def record(arguments: Namespace) -> int:
    """Write simulated drives as a camera would have recorded them."""
    from gymnasium.utils import seeding

    from shotenv.decision import open_problem
    from shotenv.env import drive_seed
    from shotenv.recorded import require_camera, write_drives

    out, seeds = arguments.out, range(arguments.seed, arguments.seed + arguments.drives)
    if arguments.drives > MOST_DRIVES:
        raise ConfigError(f"drives is {arguments.drives}; expected at most {MOST_DRIVES}")
    if out.is_dir() and any(out.iterdir()):
        raise ConfigError(f"{out} is not an empty folder; nothing is written over")
    config, (camera, _) = section_of(EnvConfig, arguments), read_camera(arguments.camera)
    kept = require_camera(camera, config.sensor)  # before minutes are spent
    prepare_bank(config)
    play_on_one_thread()
    problem = open_problem(config)
    # The drive that an environment of such a seed begins with.
    drives = {f"drive_{seed}": drive_seed(seeding.np_random(seed)[0]) for seed in seeds}
    frames = len(drives) * (config.frames_per_drive + 1)
    with progress(frames, "recording", "frame") as bar:
        write_drives(out, problem, drives, camera, tick=bar.update)
    megahertz = " and ".join(f"{hz / 1e6:g}" for hz in kept)
    print(f"{frames} frames at {megahertz} MHz, as {camera.name} stores them: {out}")
    write_numbers(arguments, {"frames": frames, "drives": len(drives), "frequencies_hz": kept})
    return DONE


RECORD = Command(
    "record", "write drives as a camera would have recorded them", record_arguments, record
)
