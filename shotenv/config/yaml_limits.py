"""YAML that would grow without measure is refused before anything is made of it.

An alias repeats what its anchor names, and what it names may have aliases in turn. Nine lists of
nine aliases each are a few hundred characters and stand for 9^9 values, which whoever walks over
them, or prints them, never gets through:

    a: &a [x, x, x, x, x, x, x, x, x]
    b: &b [*a, *a, *a, *a, *a, *a, *a, *a, *a]
    c: &c [*b, *b, *b, *b, *b, *b, *b, *b, *b]
    ...

The parser's events tell all that in one walk over the text, however much the text stands for.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import jsonargparse
import yaml
from jsonargparse import get_loader, set_loader

from unwrap.support import in_one_line, read_regular

LONGEST_TEXT = 2**18
"""Characters of a text; the longest file in `configs/` has some 4000."""

MOST_YAML_BYTES = 4 * LONGEST_TEXT
"""Of a file: UTF-8 takes up to four bytes for a character."""

MOST_VALUES = 10_000
"""Scalars, lists and mappings of a text, those that aliases repeat counted each time."""

DEEPEST = 32
"""Lists and mappings within each other."""

_Parser: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_load_yaml = get_loader("yaml")
_read_any = jsonargparse.Path.read_text


class YamlTooLarge(yaml.YAMLError):
    """A YAML text that is too long, too deep, or stands for too many values."""


def limit_yaml() -> None:
    """Make every parser of jsonargparse in this process refuse YAML beyond the limits."""
    set_loader("yaml", load_limited, (yaml.YAMLError,))
    # `--config FILE` is read by jsonargparse itself, whole, before anything looks at the text.
    jsonargparse.Path.read_text = _read_text  # type: ignore[method-assign, assignment]


def _read_text(path: jsonargparse.Path) -> str:
    """Text of a file that is named on a command line, if it is a regular one of sensible size."""
    if "://" in str(path) or str(path) == "-":
        return _read_any(path)
    try:
        return read_regular(Path(path.absolute), MOST_YAML_BYTES).decode()
    except ValueError as error:
        raise ValueError(f"{path}: {in_one_line(error)}") from None


def load_limited(text: str, path: str | Path = "") -> Any:
    """What jsonargparse makes of a YAML text, if it keeps within the limits.

    Raises
    ------
    yaml.YAMLError
        It does not, or it is not YAML; the message names `path`, where there is one.
    """
    try:
        check_limits(text)
    except YamlTooLarge as error:
        raise YamlTooLarge(f"{path}: {error}" if path else str(error)) from None
    return _load_yaml(text)


def check_limits(text: str) -> None:
    """Refuse a YAML text that is too long, too deep, or stands for too many values.

    Raises
    ------
    yaml.YAMLError
        The text is beyond `LONGEST_TEXT`, `MOST_VALUES` or `DEEPEST`, an alias is part of what
        it stands for, or the text is not YAML.
    """
    if len(text) > LONGEST_TEXT:
        raise YamlTooLarge(f"YAML of {len(text)} characters; expected at most {LONGEST_TEXT}")
    values = 0
    anchored: dict[str, int] = {}  # How many values each anchor stands for.
    unclosed: list[tuple[str | None, int]] = []  # Anchor, and the values counted before it.
    for event in yaml.parse(text, Loader=_Parser):
        if isinstance(event, yaml.ScalarEvent):
            values += 1
            if event.anchor:
                anchored[event.anchor] = 1
            # A quoted text is parsed, too, where a number is expected.
            if "*" in event.value and event.value != text:
                _check_quoted(event.value)
        elif isinstance(event, yaml.AliasEvent):
            if any(event.anchor == anchor for anchor, _ in unclosed):
                raise YamlTooLarge(f"YAML alias *{event.anchor} is part of what it stands for")
            values += anchored.get(event.anchor, 1)  # The loader refuses one without an anchor.
        elif isinstance(event, yaml.CollectionStartEvent):
            unclosed.append((event.anchor, values))
            values += 1
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, before = unclosed.pop()
            if anchor:
                anchored[anchor] = values - before
        if values > MOST_VALUES:
            raise YamlTooLarge(f"YAML of more than {MOST_VALUES} values, its aliases expanded")
        if len(unclosed) > DEEPEST:
            raise YamlTooLarge(f"YAML of more than {DEEPEST} levels")


def _check_quoted(text: str) -> None:
    """As `check_limits`, but a text that is no YAML is as good as any."""
    try:
        check_limits(text)
    except YamlTooLarge:
        raise
    except yaml.YAMLError:
        pass
