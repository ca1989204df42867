"""The command line: `shotenv COMMAND`. Words to arguments, errors to sentences and exit statuses.

Exit status: 0 done; 1 what was asked for failed, with one sentence on stderr; 2 wrong usage.
"""

from __future__ import annotations

import os
import re
import sys
import warnings
from collections.abc import Sequence
from importlib.metadata import version
from itertools import pairwise

from jsonargparse import ArgumentError, Namespace

from agents.cli import (
    bank_commands,
    collect_command,
    doctor,
    export_command,
    fetch_command,
    play_command,
    problem_command,
    schedule_commands,
    unwrap_commands,
)
from agents.cli.cameras import CALIBRATE, CORRECT, DESCRIBE, RECORD
from agents.cli.command import (
    DONE,
    FAILED,
    INTERRUPTED,
    WRONG_USAGE,
    Command,
    check_outputs,
    execution_of,
)
from shotenv.config import ConfigError, imports_refused, in_plain_words, one_sentence
from unwrap.execution import check_execution

OWN_PACKAGES = ("agents", "shotenv", "unwrap")
USUAL_FORMAT = warnings.formatwarning
HELP = ("--help", "-h", "help")
COMMANDS: tuple[Command, ...] = (
    *doctor.COMMANDS,
    *schedule_commands.COMMANDS,
    *problem_command.COMMANDS,
    *play_command.COMMANDS,
    *collect_command.COMMANDS,
    *export_command.COMMANDS,
    *bank_commands.COMMANDS,
    *fetch_command.COMMANDS,
    *unwrap_commands.COMMANDS,
    CORRECT,
    DESCRIBE,
    CALIBRATE,
    RECORD,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    before, warnings.formatwarning = warnings.formatwarning, _format_warning
    try:
        return _run(words)
    except SystemExit as leaving:  # argparse, after --help or --print_config
        return DONE if leaving.code in (None, 0) else WRONG_USAGE
    # Before ValueError, which it is: what the user typed is at fault, not what was asked for.
    except ConfigError as error:
        return _refuse(str(error), WRONG_USAGE)
    except KeyboardInterrupt:
        return _refuse("interrupted", INTERRUPTED)
    except BrokenPipeError:
        # Whoever read the output has left; Python would complain once more while closing it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except ImportError as error:
        return _refuse(f"{error}; `shotenv doctor` tells what is missing", FAILED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refuse(f"{where}{error.strerror or error}", FAILED)
    # What the rooms refuse, and what torch and mitsuba raise; any other error is a fault of this
    # program and keeps its traceback.
    except (ValueError, RuntimeError) as error:
        return _refuse(one_sentence(error), FAILED)
    finally:
        warnings.formatwarning = before


def _format_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    line: str | None = None,
) -> str:
    """A warning of this program as a sentence; others as Python tells them."""
    if category.__module__.partition(".")[0] in OWN_PACKAGES:
        return f"shotenv: warning: {message}\n"
    return USUAL_FORMAT(message, category, filename, lineno, line)


def _refuse(sentence: str, status: int) -> int:
    print(f"shotenv: {sentence}", file=sys.stderr)
    return status


def _run(words: list[str]) -> int:
    if words == ["--version"]:
        print(version("shotenv"))
        return DONE
    for command in COMMANDS:
        # No command's words begin another's, so that the first that fits is the one.
        own = command.words.split()
        if words[: len(own)] == own:
            arguments = _parsed(command, words[len(own) :])
            try:
                return command.action(arguments)
            except KeyboardInterrupt as stop:
                next_time = "continues where it stopped" if command.resumes else "starts over"
                # What was interrupted may know better what is kept.
                told = str(stop) or f"the same command {next_time}"
                return _refuse(f"interrupted; {told}", INTERRUPTED)
    return _overview(words)


def _parsed(command: Command, words: list[str]) -> Namespace:
    """Arguments of a command, sections as their models.

    Raises
    ------
    ConfigError
        An unknown argument or key, or a value that is of no use; one sentence that names it.
    """
    parser = command.parser()
    for before, word in pairwise(("", *words)):
        # As a path it would be the present folder.
        if not word or re.fullmatch("--[^=]+=", word):
            name = word or before
            raise ConfigError(
                f"{name.strip('-=') or 'the first argument'} is empty; expected a value"
            )
    try:
        with imports_refused():
            arguments = parser.instantiate(parser.parse_args(words))
    except (ArgumentError, ValueError, TypeError) as error:
        raise ConfigError(in_plain_words(one_sentence(error))) from None
    # Before minutes are spent on what could not be written then.
    check_outputs(arguments, out_is_file=command.out_is_file)
    if "executor" in arguments:
        check_execution(**execution_of(arguments))
    return arguments


def _overview(words: list[str]) -> int:
    """List the commands, or those that begin with the words given."""
    asked = [word for word in words if word not in HELP]
    matching = [c for c in COMMANDS if c.words.split()[: len(asked)] == asked]
    if not matching:
        known = ", ".join(command.words for command in COMMANDS)
        raise ConfigError(f"command is {' '.join(asked)!r}; expected one of {known}")
    # Asked for, the list is the answer; without `--help` it says what was wrong.
    stream = sys.stderr if asked == words else sys.stdout
    print("usage: shotenv COMMAND [--help] [arguments]\n", file=stream)
    for command in matching:
        print(f"  {command.words:18}{command.help}", file=stream)
    return WRONG_USAGE if asked == words else DONE
