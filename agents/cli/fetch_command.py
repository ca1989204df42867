"""Command that brings what was published at a URL into a folder."""

from __future__ import annotations

import hashlib
from pathlib import Path

from jsonargparse import ArgumentParser, Namespace

from agents.cli.command import DONE, Command
from unwrap.storage import Listing, Place, fetch, read_contents
from unwrap.support import open_regular, progress


def fetch_arguments(parser: ArgumentParser) -> None:
    """From where, and where to."""
    parser.add_argument("url", help="place of a study, of trainings or of a bank")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write")


def fetch_published(arguments: Namespace) -> int:
    """Fetch all files; what was fetched before is kept, and nothing is written over."""
    place, folder = Place(arguments.url), arguments.out
    contents = read_contents(place)
    _require_own(contents, folder)
    with progress(contents.total_bytes, f"fetching {contents.label}", "B") as bar:
        bar.unit_scale = True
        fetch(place, contents, folder, tick=bar.update)
    print(f"{contents.label}, {len(contents.files)} files, is in {folder}")
    return DONE


def _require_own(contents: Listing, folder: Path) -> None:
    """Refuse a folder with a file in the place of one that is to be fetched.

    Raises
    ------
    ValueError
        Names it.
    """
    for file in contents.files:
        path = folder / file.path
        if not path.exists():
            continue
        with open_regular(path) as standing:
            digest = hashlib.file_digest(standing, "sha256").hexdigest()
        if digest != file.sha256:
            raise ValueError(
                f"{path} is not what is published; choose another folder, nothing is written over"
            )


COMMANDS = (
    Command(
        "fetch",
        "bring a study, trainings or a bank from a place (a bucket) into a folder",
        fetch_arguments,
        fetch_published,
        resumes=True,
    ),
)
