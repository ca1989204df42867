"""Commands that write drives for others to read: for Minari, for Rerun, and as a camera does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import NonNegativeInt, PositiveInt

from agents.cli.camera_commands import read_camera
from agents.cli.command import (
    DONE,
    Command,
    add_config,
    add_json,
    add_trust,
    section_of,
    write_numbers,
)
from agents.cli.experiment import (
    add_experiment,
    experiment_of,
    play_on_one_thread,
    prepare_bank,
)
from agents.cli.play_command import policy_of
from shotenv.config import EnvConfig
from unwrap.support import progress


def collect_arguments(parser: ArgumentParser) -> None:
    """Which data set, who plays, how many drives, and the experiment."""
    parser.add_argument("dataset", help="name of the data set, such as shotenv/random-v0")
    parser.add_argument(
        "--policy", default="random", help="random, always_2, _4 or _8, or a scheduler's folder"
    )
    parser.add_argument("--episodes", type=PositiveInt, default=24, help="drives to play")
    parser.add_argument("--first_seed", type=NonNegativeInt, default=0, help="seed of the first")
    parser.add_argument("--id", default="shotenv/ShotSchedule-v0", help="id of the environment")
    parser.add_argument(
        "--outcomes", type=bool, default=False, help="tell what every action would have brought"
    )
    add_trust(parser)
    add_experiment(parser)


def collect(arguments: Namespace) -> int:
    """Play drives and write them."""
    import gymnasium
    import numpy as np

    from agents.evaluation import play_episodes, require_minari, write_dataset

    require_minari()  # before minutes are spent
    policy = policy_of("policy", arguments.policy, trust=arguments.trust)
    config = experiment_of(arguments)
    prepare_bank(config.env)
    play_on_one_thread()
    env = gymnasium.make(
        arguments.id, outcomes=arguments.outcomes, **config.env.model_dump(mode="json")
    )
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.episodes)
    with progress(len(seeds) * config.env.frames_per_drive, "playing drives", "frame") as bar:
        episodes = play_episodes(policy, env, seeds, tick=bar.update)
    name = Path(arguments.policy).name
    dataset = write_dataset(
        arguments.dataset,
        env,
        episodes,
        policy=name,
        description=f"{len(seeds)} drives of {arguments.id}, split {config.env.split}, by {name}",
    )
    # Of a reward that is a vector, the sum of each of its components.
    returns = [np.sum(episode.rewards, axis=0).tolist() for episode in episodes]
    print(f"{dataset.total_steps} frames are in {Path(str(dataset.storage.data_path)).parent}")
    write_numbers(arguments, {"frames": int(dataset.total_steps), "returns": returns})
    return DONE


def rerun_arguments(parser: ArgumentParser) -> None:
    """Which file, which drive, who plays it, and the experiment."""
    parser.add_argument("file", type=Path, help="recording to write, such as runs/drive.rrd")
    parser.add_argument(
        "--policy", default="always_8", help="random, always_2, _4 or _8, or a scheduler's folder"
    )
    parser.add_argument("--seed", type=NonNegativeInt, default=0, help="seed of the drive")
    add_experiment(parser)


def rerun(arguments: Namespace) -> int:
    """Play a drive and write it."""
    from agents.evaluation import make_envs, play_drives
    from agents.report import require_rerun, write_recording
    from shotenv.decision import open_problem

    require_rerun()  # before minutes are spent
    policy, config = policy_of("policy", arguments.policy), experiment_of(arguments)
    prepare_bank(config.env)
    play_on_one_thread()
    problem = open_problem(config.env)
    envs = make_envs(config.env, config.env.split, 1, "Disabled")
    played = play_drives(policy, envs, [arguments.seed])
    frames, name = config.env.frames_per_drive, Path(arguments.policy).name
    with progress(frames, "writing the drive", "frame") as bar:
        write_recording(
            arguments.file, problem, played, f"drive {arguments.seed}, {name}", tick=bar.update
        )
    print(f"{frames} frames are in {arguments.file}; `rerun {arguments.file}` shows them.")
    known = {name: float(of[0]) for name, of in played.per_drive.items() if np.isfinite(of[0])}
    write_numbers(arguments, known)
    return DONE


def record_arguments(parser: ArgumentParser) -> None:
    """Which drives, which camera, and where its recordings go."""
    parser.add_argument("--camera", required=True, help="name or path of a camera's description")
    parser.add_argument("--drives", type=PositiveInt, default=4, help="drives to record")
    parser.add_argument("--seed", type=NonNegativeInt, default=0, help="seed of the first")
    parser.add_argument(
        "--out", type=Path, required=True, metavar="FOLDER", help="of the recordings"
    )
    add_config(parser, EnvConfig, "env/default.yaml")
    add_json(parser)


def record(arguments: Namespace) -> int:
    """Write simulated drives as a camera would have recorded them."""
    from shotenv.decision import open_problem
    from shotenv.recording import require_camera, write_drives

    config, (camera, _) = section_of(EnvConfig, arguments), read_camera(arguments.camera)
    kept = require_camera(camera, config.sensor)  # before minutes are spent
    prepare_bank(config)
    play_on_one_thread()
    problem = open_problem(config)
    seeds = range(arguments.seed, arguments.seed + arguments.drives)
    frames = len(seeds) * (config.frames_per_drive + 1)
    with progress(frames, "recording", "frame") as bar:
        write_drives(arguments.out, problem, seeds, camera, tick=bar.update)
    megahertz = " and ".join(f"{hz / 1e6:g}" for hz in kept)
    print(f"{frames} frames at {megahertz} MHz, as {camera.name} stores them: {arguments.out}")
    write_numbers(arguments, {"frames": frames, "drives": len(seeds), "frequencies_hz": kept})
    return DONE


COMMANDS = (
    Command("collect", "write drives as a Minari data set", collect_arguments, collect),
    Command(
        "record", "write drives as a camera would have recorded them", record_arguments, record
    ),
    Command("rerun", "write a drive for the Rerun viewer", rerun_arguments, rerun),
)
