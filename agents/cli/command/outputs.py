"""Where a command is to write, looked at before it works for minutes."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from jsonargparse import Namespace

from shotenv.config import ConfigError

SCHEME = re.compile(r"[A-Za-z][A-Za-z0-9+.-]+:/")
"""What a path begins with that was made of a URL."""
FILES, FOLDERS = ("json", "sheet", "mcap", "rrd"), ("out", "page")
"""Arguments that name what is written, in every command that has them."""


def check_outputs(arguments: Namespace, *, out_is_file: bool = False) -> None:
    """Refuse places that cannot be written to; nothing is made or changed.

    Parameters
    ----------
    out_is_file : bool
        Whether `--out` of this command is a file; of most it is a folder.

    Raises
    ------
    ConfigError
        A URL where a path is wanted, a folder where a file is, a file where a folder is, or one
        within a file or a folder that may not be written to; the message names argument and place.
    """
    for name, path in _outputs(arguments):
        if SCHEME.match(str(path)):
            raise ConfigError(f"{name} is {path}, of a URL; expected a path of this machine")
        is_folder = name in FOLDERS and not (name == "out" and out_is_file)
        if is_folder and path.exists() and not path.is_dir():
            raise ConfigError(f"{name} is {path}, which is a file; expected a folder")
        if not is_folder and path.is_dir():
            raise ConfigError(f"{name} is {path}, which is a folder; expected a file")
        # The folder that a file is written into, or the next one above that stands already.
        above = path if is_folder else path.parent
        while not (above.exists() or above.is_symlink()) and above != above.parent:
            above = above.parent
        if not above.is_dir():
            raise ConfigError(f"{name} is {path}, but {above} is no folder; expected another place")
        if not os.access(above, os.W_OK | os.X_OK):
            raise ConfigError(
                f"{name} is {path}, but {above} may not be written to; expected another place"
            )


def _outputs(arguments: Namespace) -> Iterator[tuple[str, Path]]:
    """Name of each argument that names an output, and the path."""
    for name in (*FILES, *FOLDERS):
        path = arguments.get(name)
        # A place is a str, see `add_out_or_url`.
        if isinstance(path, Path):
            yield name, path
