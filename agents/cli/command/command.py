"""What every command is, and the arguments that several of them share."""

from __future__ import annotations

from argparse import ArgumentTypeError
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import PositiveInt
from pydantic import BaseModel

from shotenv.config import configs_dir
from unwrap.support import Section, write_json

# 130 is what shells report of a program that Ctrl-C ended: 128 + SIGINT.
DONE, FAILED, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130


@dataclass(frozen=True)
class Command:
    """One command: its words, what it is for, its arguments and what it does.

    Attributes
    ----------
    words, help : str
    arguments : callable
        Adds the command's own arguments to a parser.
    action : callable
        Does the work with the parsed arguments and returns the exit status.
    resumes : bool
        Whether the same command continues where an interrupted one stopped.
    out_is_file : bool
        Whether its `--out` is a file; else it is a folder.
    """

    words: str
    help: str
    arguments: Callable[[ArgumentParser], None]
    action: Callable[[Namespace], int]
    resumes: bool = False
    out_is_file: bool = False

    def parser(self) -> ArgumentParser:
        """Parser of the command's own arguments."""
        parser = ArgumentParser(
            prog=f"shotenv {self.words}",
            description=self.help,
            exit_on_error=False,  # `main` turns errors into one sentence and an exit status
            allow_abbrev=False,  # else a misspelt option may be taken for the start of another
        )
        self.arguments(parser)
        return parser


def add_config(parser: ArgumentParser, section: type[Section], default: str) -> None:
    """`--config FILE` and an override for each field, over the shipped file `default`."""
    parser.default_config_files = [str(configs_dir() / default)]
    parser.add_argument("--config", action="config", help="YAML file over the defaults")
    parser.add_class_arguments(section, None, sub_configs=True)


def add_executor(parser: ArgumentParser, tasks: str, default: str = "one per core") -> None:
    """`--executor` and `--workers`, see `execution_of`."""
    from unwrap.execution import Executor

    parser.add_argument(
        "--executor",
        type=Executor,
        default="local",
        help="local: processes of this machine; ray: the cluster that RAY_ADDRESS names",
    )
    parser.add_argument(
        "--workers", type=PositiveInt, metavar="N", help=f"{tasks} at a time; {default}"
    )


def execution_of(arguments: Namespace) -> dict[str, Any]:
    """What `add_executor` asked for, as keyword arguments."""
    return {name: arguments[name] for name in ("executor", "workers")}


def add_json(parser: ArgumentParser) -> None:
    """`--json FILE`, see `write_numbers`."""
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers to FILE")


def add_out(parser: ArgumentParser, default: str, what: str) -> None:
    """`--out DIR`."""
    parser.add_argument("--out", type=Path, default=Path(default), metavar="DIR", help=what)


def add_out_or_url(parser: ArgumentParser, default: str, what: str) -> None:
    """`--out DIR`, or the URL of a place: a path, or a str."""
    parser.add_argument(
        "--out",
        type=_path_or_url,
        default=Path(default),
        metavar="DIR",
        help=f"{what}; or the URL of a place, such as s3://bucket/study",
    )


def add_place(parser: ArgumentParser, what: str, *, required: bool = False) -> None:
    """`--to URL`."""
    parser.add_argument("--to", type=_url, required=required, metavar="URL", help=what)


def _url(text: str) -> str:
    from unwrap.storage import is_url

    if not is_url(text):
        # `bank info` and others would take it for the folder of a bank.
        raise ArgumentTypeError(f"{text} is no URL; expected one such as s3://bucket/bank")
    return text


def _path_or_url(text: str) -> Path | str:
    from unwrap.storage import is_url, require_plain

    if not is_url(text):
        return Path(text)
    require_plain(text)
    return text  # A path would make one slash of the two.


def add_sensor_and_merge(parser: ArgumentParser) -> None:
    """`--sensor` and `--merge`."""
    from unwrap.depth import Merge

    parser.add_argument("--sensor", default="epc660", help="name or path of a sensor configuration")
    # Listed by its type, so that a new rule is told of here as soon as it has a name.
    rules = ", ".join(get_args(Merge))
    parser.add_argument("--merge", type=Merge, default="nearest", help=f"merge rule: {rules}")


def add_trust(parser: ArgumentParser) -> None:
    """`--trust`, without which zips of stable-baselines3 are refused."""
    parser.add_argument(
        "--trust",
        action="store_true",
        help="take a zip of stable-baselines3 (PPO, A2C, DQN, QR-DQN): features are not checked",
    )


def write_numbers(arguments: Namespace, numbers: Any) -> None:
    """Write `numbers` to the file that `--json` names, if any."""
    if arguments.json is not None:
        write_json(arguments.json, numbers)


def section_of(model: type[BaseModel], arguments: Namespace) -> Any:
    """The section whose fields are among the arguments."""
    return model(**{name: arguments[name] for name in model.model_fields})
