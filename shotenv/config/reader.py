"""YAML files to models, and changes to models: what enters is checked, and refused by name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import jsonargparse
from pydantic import ValidationError

from shotenv.config.imported_names import imports_refused
from shotenv.config.yaml_limits import MOST_YAML_BYTES, limit_yaml
from unwrap.support import Section, in_short, require_regular

# Here and not in `read_config`: the command line's own parsers read files, too, and each of them is
# made of names that come through this file.
limit_yaml()

Model = TypeVar("Model", bound=Section)
UNKNOWN_KEY = re.compile(r"does not accept option '([\w.]+)'")
"""What jsonargparse says of a key that a file has and its section has not."""
NO_MAPPING = re.compile(r"""^.*Parser key "([\w.]+)": Unable to load config "(.*)"$""")
NOT_LOADED = re.compile(r"""^Parser key "config": Unable to load config '.*?' - """)
"""What it says of a file that is a word or a list, and before what YAML says of it."""
# In turn: where jsonargparse found it, pydantic's count of errors, its and jsonargparse's words for
# what was expected, what it says of a file twice, of classes, and pydantic's note on the value.
PLAINER = (
    (r'Parser key "config": ', ""),
    (r'Parser key "([^"]+)"(?: element \d+)?: ', r"\1: "),
    (r"\d+ validation errors? for (?:function-\w+\[.*?\]|[\w-]+(?:\[.*?\])?) ", ""),
    (r"\b(\d+) Field required", r"element \1 is missing"),
    (r"Input should be", "expected to be"),
    (r"Not of type \w+: (\S+) does not conform to restriction v>0", r"\1; expected above 0"),
    (r"Not of type \w+: (\S+) does not conform to restriction v>=0", r"\1; expected at least 0"),
    (r"Not of type \w+: invalid literal for int\(\).*?: (.*)", r"\1; expected a whole number"),
    (r"Expected a (?:typing\.)?Literal\[(.*?)\]\. Got value: (.*)", r"\2; expected one of \1"),
    (r"Expected a <class '(\w+)'>\. Got value: (.*)", r"\2; expected \1"),
    (
        r"""Unable to load config '(.*?)' - .*Unable to load config ".*\"""",
        r"\1; expected a file of keys with values",
    ),
    (
        r"Subclasses are disabled for (\w+), thus '(.*?)' is not accepted as class_path\..*",
        r"class_path is '\2'; expected the keys of \1",
    ),
    (r"\[type=\w+, input_value=(.*?), input_type=\w+\]", r"(got \1)"),
)
"""Patterns of what libraries say, and what a user is told."""
MOST_COMPLAINTS = 8
"""Told of one file, which may be wrong in thousands of places."""


class ConfigError(ValueError):
    """A configuration that cannot be used; the message names field, value and expectation."""


def configs_dir() -> Path:
    """Folder of the shipped YAML files: beside the package in a checkout, inside it in a wheel."""
    inside = Path(__file__).parents[1] / "configs"
    return inside if inside.is_dir() else Path(__file__).parents[2] / "configs"


def find_config(section: str, name: str) -> Path:
    """File of configuration `name` (a name in `configs/<section>/`, or a path).

    Raises
    ------
    ConfigError
        There is no such name and no such file.
    """
    shipped = configs_dir() / section
    # Names first: a file or folder of that name may lie about in the working directory.
    for candidate in (shipped / f"{name}.yaml", Path(name)):
        if candidate.is_file():
            return candidate
    known = ", ".join(sorted(path.stem for path in shipped.glob("*.yaml"))) or "none"
    raise ConfigError(f"{section} is {name!r}; expected one of {known}, or the path of a YAML file")


def read_config(model: type[Model], path: Path, overrides: Sequence[str] = ()) -> Model:
    """Read `path` into `model`; `overrides` are command-line words such as `--reward.power 0.3`.

    Raises
    ------
    ConfigError
        An unknown key, a wrong type or a value out of range, named with its key; or YAML that is
        oversized, or would be when its aliases are expanded.
    """
    parser = jsonargparse.ArgumentParser(exit_on_error=False)
    # Under a key of its own: `config.name` cannot be taken for an argument of the parser.
    parser.add_class_arguments(model, "config", sub_configs=True)
    words = [f"--config.{word[2:]}" if word.startswith("--") else word for word in overrides]
    try:
        require_regular(path, MOST_YAML_BYTES)
        with imports_refused():
            return parser.instantiate(parser.parse_args(["--config", str(path), *words])).config
    except (jsonargparse.ArgumentError, ValueError, TypeError, OSError) as error:
        sentence = one_sentence(error)
        if (unknown := UNKNOWN_KEY.search(sentence)) is not None:
            sentence = _unknown(unknown[1].split("."), model)
        if (word := NO_MAPPING.search(sentence)) is not None:
            sentence = _no_mapping(*word.groups())
        # Some of these errors begin with the file.
        sentence = NOT_LOADED.sub("", sentence).removeprefix(f"{path.name}: ")
        raise ConfigError(f"{path.name}: {in_plain_words(sentence)}") from None


def one_sentence(error: Exception, model: type[Section] | None = None) -> str:
    """What a validation error says, on one line, without the library's own advertising.

    Of an unknown key it tells the known ones, where `model`, the section read, is given.
    """
    if isinstance(error, ValidationError):
        found = error.errors()
        told = "; ".join(_complaint(detail, model) for detail in found[:MOST_COMPLAINTS])
        left = len(found) - MOST_COMPLAINTS
        return f"{told}; and {left} more" if left > 0 else told
    if isinstance(error, OSError) and error.strerror:
        return error.strerror  # Whoever tells it names the file.
    kept = [line.strip() for line in str(error).splitlines() if "errors.pydantic.dev" not in line]
    return " ".join(" ".join(kept).replace("config.", "").split())


def in_plain_words(sentence: str) -> str:
    """A complaint of jsonargparse or pydantic without what only the libraries' authors need."""
    for pattern, kept in PLAINER:
        sentence = re.sub(pattern, kept, sentence)
    return sentence


def _complaint(detail: Any, model: type[Section] | None) -> str:
    """One of the errors that pydantic found, as `field: what was expected, got value`."""
    where = ".".join(str(part) for part in detail["loc"]) or "configuration"
    message = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "extra_forbidden":
        return _unknown(detail["loc"], model)
    # Of what is missing, the input is all around it.
    if not detail["loc"] or detail["type"] == "missing":
        return f"{where}: {message}" if detail["loc"] else message
    return f"{where}: {message}, got {in_short(detail['input'])}"


def _unknown(place: Sequence[Any], model: Any) -> str:
    """Refusal of the key at `place`, such as ("reward", "energy"), of the section `model`."""
    for depth, key in enumerate(place, 1):
        fields = getattr(model, "model_fields", {})
        if fields and key not in fields:
            # What lies below an unknown key is not to be known.
            known = ", ".join(fields)
            return f"unknown key {'.'.join(map(str, place[:depth]))}; expected one of {known}"
        model = fields[key].annotation if fields else None
    return f"unknown key {'.'.join(map(str, place))}"


def _no_mapping(key: str, value: str) -> str:
    """Refusal of a word, a list or no file where the section `key` is to be, or the whole."""
    if key == "config":
        return "expected keys with values"
    return f"{key} is {value!r}; expected keys with values, or a YAML file of them"


def merged(base: Model, changes: Mapping[str, Any]) -> Model:
    """`base` with the (possibly nested) plain values of `changes`, validated again.

    Raises
    ------
    ConfigError
        An unknown key, a wrong type or a value out of range; the message names the key.
    """
    try:
        return type(base).model_validate(_overlay(base.model_dump(), changes))
    except ValidationError as error:
        raise ConfigError(one_sentence(error, type(base))) from None


def _overlay(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with the values of `changes`; a mapping changes single values of a mapping."""
    result = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = _overlay(result[key], value) if nested else value
    return result
