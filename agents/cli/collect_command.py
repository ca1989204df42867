"""Commands that write drives for others to read: a data set of Minari, a recording for Rerun."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import NonNegativeInt, PositiveInt

from agents.cli.command import (
    DONE,
    Command,
    add_experiment,
    add_trust,
    experiment_of,
    play_on_one_thread,
    prepare_bank,
    write_numbers,
)
from agents.cli.play_command import policy_of
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
    parser.add_argument(
        "rrd", metavar="FILE", type=Path, help="recording to write, such as runs/drive.rrd"
    )
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
            arguments.rrd, problem, played, f"drive {arguments.seed}, {name}", tick=bar.update
        )
    print(f"{frames} frames are in {arguments.rrd}; `rerun {arguments.rrd}` shows them.")
    known = {name: float(of[0]) for name, of in played.per_drive.items() if np.isfinite(of[0])}
    write_numbers(arguments, known)
    return DONE


COMMANDS = (
    Command("collect", "write drives as a Minari data set", collect_arguments, collect),
    Command("rerun", "write a drive for the Rerun viewer", rerun_arguments, rerun),
)
