"""The command with which a person takes a drive, against a policy on the same drive."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import NonNegativeFloat, NonNegativeInt

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
from shotenv.config import ConfigError

if TYPE_CHECKING:
    from agents.evaluation import Match
    from agents.policies import Policy

ACTION_OF_KEY = {"2": 0, "4": 1, "8": 2, "[2]": 0, "[4]": 1, "[8]": 2}
"""Keys, those of the number pad too, and their actions."""
POLLS_PER_S = 30.0
"""How often keys are looked at where a frame waits for one."""


@dataclass
class Controls:
    """What the keys pressed so far ask for.

    Attributes
    ----------
    action : int
        Of the frames from now on.
    paused, ended : bool
    fresh : bool
        Whether the action was chosen since the last frame.
    """

    action: int = 2
    paused: bool = False
    ended: bool = False
    fresh: bool = False

    def press(self, keys: Iterable[str]) -> None:
        """Take in the names of the keys that were pressed."""
        for key in keys:
            if key in ACTION_OF_KEY:
                self.action, self.fresh = ACTION_OF_KEY[key], True
            elif key == "space":
                self.paused = not self.paused
            elif key in ("q", "escape", "quit"):
                self.ended = True


def play_arguments(parser: ArgumentParser) -> None:
    """Which drive, against whom, how fast, and the experiment."""
    parser.add_argument("--drive", type=NonNegativeInt, default=0, help="seed of the drive")
    parser.add_argument(
        "--against", default="always_8", help="folder of a trained scheduler, or always_2, _4 or _8"
    )
    parser.add_argument(
        "--pace",
        type=NonNegativeFloat,
        default=4.0,
        help="frames per second; 0 waits for a key in every frame",
    )
    add_trust(parser)
    add_experiment(parser)


def play(arguments: Namespace) -> int:
    """Open a window and play a drive."""
    from agents.evaluation import Match
    from shotenv.env import Window

    rival = policy_of("against", arguments.against, trust=arguments.trust)
    config = experiment_of(arguments)
    env = config.env.model_copy(update={"split": config.study.split})
    window = Window(arguments.pace or POLLS_PER_S)
    try:
        prepare_bank(env)
        play_on_one_thread()
        match = Match(env, rival, arguments.drive)
        play_match(match, window, Path(arguments.against).name, waits=not arguments.pace)
    finally:
        window.close()
    print_match(match, Path(arguments.against).name)
    write_numbers(arguments, {"you": match.person.numbers, "rival": match.rival.numbers})
    return DONE


def policy_of(argument: str, name: str, *, trust: bool = False) -> Policy:
    """The policy that `--argument` names.

    Raises
    ------
    ConfigError
        It is neither random nor a fixed choice nor the folder or zip of a scheduler.
    """
    from agents.evaluation import FIXED_POLICIES
    from agents.policies import RandomPolicy, load_policy

    known: dict[str, Policy] = {"random": RandomPolicy(), **FIXED_POLICIES}
    if name in known:
        return known[name]
    if not Path(name).exists():
        listed = ", ".join(known)
        raise ConfigError(f"{argument} is {name!r}; expected {listed} or a scheduler's folder")
    return load_policy(name, trust=trust)


def play_match(match: Match, window: Any, rival: str, *, waits: bool) -> None:
    """Play until the drive is over or the person ends it; `waits` for a key in every frame."""
    from agents.report import match_picture

    controls = Controls()
    while not match.over and not controls.ended:
        window.show(match_picture(match, rival))
        controls.press(window.keys())
        held = controls.paused or (waits and not controls.fresh)
        if not controls.ended and not held:
            match.play(controls.action)
            controls.fresh = False


def print_match(match: Match, rival: str) -> None:
    """Say how it ended."""
    from agents.report import lines_of

    for name, tally in (("you", match.person), (rival, match.rival)):
        print("\n".join(lines_of(name, tally)))
    ahead = match.person.score - match.rival.score
    print(f"You are {abs(ahead):.2f} {'ahead of' if ahead > 0 else 'behind'} {rival}.")


COMMANDS = (Command("play", "take a drive yourself, against a policy", play_arguments, play),)
