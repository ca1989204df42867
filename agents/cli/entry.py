"""The command line: `shotenv COMMAND`. Arguments and errors here, the work in `agents.cli.commands`.

Exit status: 0 done; 1 what was asked for failed, with one sentence on stderr; 2 wrong usage.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from jsonargparse import ArgumentError, ArgumentParser, Namespace
from jsonargparse.typing import PositiveInt

from agents.config import DemoConfig
from shotenv.config import BankConfig, ConfigError, configs_dir, one_sentence
from unwrap.support import Section

DONE, FAILED, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130


@dataclass(frozen=True)
class Command:
    """One command: its words, what it does, and its arguments."""

    words: str
    help: str
    arguments: Callable[[ArgumentParser], None]

    @property
    def function(self) -> Callable[[Namespace], int]:
        """What does the work, in `agents.cli.commands`."""
        return getattr(import_module("agents.cli.commands"), self.words.replace(" ", "_"))

    def parser(self) -> ArgumentParser:
        """Parser of the command's own arguments."""
        parser = ArgumentParser(
            prog=f"shotenv {self.words}",
            description=self.help,
            exit_on_error=False,
            allow_abbrev=False,
        )
        self.arguments(parser)
        return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        return _run(words)
    except SystemExit as leaving:  # argparse, after --help or --print_config
        return DONE if leaving.code in (None, 0) else WRONG_USAGE
    except ConfigError as error:
        return _refuse(str(error), WRONG_USAGE)
    except KeyboardInterrupt:
        return _refuse("interrupted; the same command continues where it stopped", INTERRUPTED)
    except BrokenPipeError:
        # Whoever read the output has left; Python would complain once more while closing it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except ImportError as error:
        return _refuse(f"{error}; `shotenv doctor` tells what is missing", FAILED)
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        return _refuse(f"{where}{error.strerror or error}", FAILED)
    except (ValueError, RuntimeError) as error:
        return _refuse(one_sentence(error), FAILED)


def _refuse(sentence: str, status: int) -> int:
    print(f"shotenv: {sentence}", file=sys.stderr)
    return status


def _run(words: list[str]) -> int:
    if words == ["--version"]:
        print(version("shotenv"))
        return DONE
    for command in COMMANDS:
        own = command.words.split()
        if words[: len(own)] == own:
            return command.function(_parsed(command, words[len(own) :]))
    return _overview(words)


def _parsed(command: Command, words: list[str]) -> Namespace:
    """Arguments of a command, sections as their models.

    Raises
    ------
    ConfigError
        An unknown argument or key, or a value that is of no use; one sentence that names it.
    """
    parser = command.parser()
    try:
        return parser.instantiate(parser.parse_args(words))
    except (ArgumentError, ValueError, TypeError) as error:
        raise ConfigError(_plain(one_sentence(error))) from None


def _plain(message: str) -> str:
    """A validation message without what only the libraries' authors need."""
    for pattern, kept in (
        (r'Parser key "([^"]+)": ', r"\1: "),
        (r"\d+ validation errors? for [\w-]+ ", ""),
        (r"Input should be", "expected to be"),
        (r"Not of type \w+: (\S+) does not conform to restriction v>0", r"\1; expected above 0"),
        (r"\[type=\w+, input_value=(.*?), input_type=\w+\]", r"(got \1)"),
    ):
        message = re.sub(pattern, kept, message)
    return message


def _overview(words: list[str]) -> int:
    """List the commands, or those that begin with the words given."""
    asked = [word for word in words if word not in HELP]
    matching = [c for c in COMMANDS if c.words.split()[: len(asked)] == asked]
    if not matching:
        known = ", ".join(command.words for command in COMMANDS)
        raise ConfigError(f"command is {' '.join(asked)!r}; expected one of {known}")
    stream = sys.stderr if asked == words else sys.stdout
    print("usage: shotenv COMMAND [--help] [arguments]\n", file=stream)
    for command in matching:
        print(f"  {command.words:18}{command.help}", file=stream)
    return WRONG_USAGE if asked == words else DONE


def _experiment(parser: ArgumentParser) -> None:
    """Environment, agent and drives, from `configs/demo.yaml` unless told otherwise."""
    _config(parser, DemoConfig, "demo.yaml")
    _json(parser)


def _config(parser: ArgumentParser, section: type[Section], default: str) -> None:
    parser.default_config_files = [str(configs_dir() / default)]
    parser.add_argument("--config", action="config", help="YAML file over the defaults")
    parser.add_class_arguments(section, None, sub_configs=True)


def _json(parser: ArgumentParser) -> None:
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to FILE")


def _out(parser: ArgumentParser, default: str, what: str) -> None:
    parser.add_argument("--out", type=Path, default=Path(default), metavar="DIR", help=what)


def _doctor(parser: ArgumentParser) -> None:
    _json(parser)


def _demo(parser: ArgumentParser) -> None:
    _experiment(parser)
    _out(parser, "runs/demo", "folder of the results and the report")


def _render(parser: ArgumentParser) -> None:
    _config(parser, BankConfig, "bank/starter.yaml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the bank")
    parser.add_argument("--workers", type=PositiveInt, metavar="N", help="processes; one per core")


def _bank_info(parser: ArgumentParser) -> None:
    parser.add_argument("bank", nargs="?", help="name or path of a bank; all that are known")
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="write a contact sheet (PNG)")
    parser.add_argument("--clips", type=PositiveInt, default=3, help="on the sheet, per family")
    _json(parser)


def _bank_verify(parser: ArgumentParser) -> None:
    parser.add_argument("bank", help="name or path of a bank")
    _json(parser)


def _unwrap_train(parser: ArgumentParser) -> None:
    from unwrap.training import TrainConfig

    parser.add_argument("--config", action="config", help="YAML file over the defaults")
    parser.add_class_arguments(TrainConfig, None, sub_configs=True)
    _out(parser, "runs/unwrap", "folder of the weights and the checkpoint")


def _unwrap_evaluate(parser: ArgumentParser) -> None:
    parser.add_argument("unwrapper", help="name or path of a network")
    parser.add_argument("--bank", default="starter", help="name or path of a bank")
    parser.add_argument("--split", default="test", help="train, validation, test, shift or all")
    _json(parser)


def _unwrap_table(parser: ArgumentParser) -> None:
    from unwrap.comparison import TableConfig

    _config(parser, TableConfig, "unwrap/table-small.yaml")
    parser.add_argument("--only", nargs="+", metavar="NETWORK", help="train these, score nothing")
    parser.add_argument(
        "--page", type=Path, metavar="DIR", help="folder of the page; that of --out"
    )
    _out(parser, "runs/table", "folder of the networks")
    _json(parser)


def _unwrap_correct(parser: ArgumentParser) -> None:
    from unwrap.recordings import add_arguments

    add_arguments(parser)
    _json(parser)


def _unwrap_export(parser: ArgumentParser) -> None:
    from unwrap.export import add_arguments

    add_arguments(parser)
    _json(parser)


def _train(parser: ArgumentParser) -> None:
    _experiment(parser)
    _out(parser, "runs/agent", "folder of the scheduler and its checkpoint")


def _evaluate(parser: ArgumentParser) -> None:
    parser.add_argument("scheduler", type=Path, help="folder of a trained scheduler")
    _experiment(parser)
    _out(parser, "runs/evaluation", "folder of the results and the report")


def _report(parser: ArgumentParser) -> None:
    parser.add_argument("results", type=Path, help="folder that an evaluation wrote")


HELP = ("--help", "-h", "help")
COMMANDS = (
    Command("doctor", "say what is installed, what is missing and what mends it", _doctor),
    Command("demo", "render, train a scheduler, compare it with baselines, write a report", _demo),
    Command("render", "render a bank of worlds; continues where it stopped", _render),
    Command("bank info", "list the banks, or tell and show what is in one", _bank_info),
    Command("bank verify", "check every file of a bank against its checksum", _bank_verify),
    Command("unwrap train", "train an unwrapping network on a rendered bank", _unwrap_train),
    Command("unwrap evaluate", "measure an unwrapping network on a bank", _unwrap_evaluate),
    Command(
        "unwrap table", "train every method of the results table and score them", _unwrap_table
    ),
    Command("unwrap correct", "correct recorded samples: depth, points, picture", _unwrap_correct),
    Command("unwrap export", "write a network as ONNX and check it against torch", _unwrap_export),
    Command("train", "train a scheduler with PPO; continues where it stopped", _train),
    Command("evaluate", "compare a trained scheduler with baselines, write a report", _evaluate),
    Command("report", "write the report of an evaluation anew", _report),
    Command("problem", "measure how much there is to win in the decision problem", _experiment),
)
