"""TODO."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from unwrap.support import Section


class ConfigError(ValueError):
    """A configuration that cannot be used; the message names field, value and expectation."""


Model = TypeVar("Model", bound=Section)


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
        An unknown key, a wrong type or a value out of range; the message names the key.
    """
    import jsonargparse

    parser = jsonargparse.ArgumentParser(exit_on_error=False)
    parser.add_class_arguments(model, "config", sub_configs=True)
    words = [_under(word, "config") for word in overrides]
    try:
        return parser.instantiate(parser.parse_args(["--config", str(path), *words])).config
    except (jsonargparse.ArgumentError, ValueError, TypeError, OSError) as error:
        raise ConfigError(f"{path.name}: {one_sentence(error)}") from None


def _under(word: str, group: str) -> str:
    return f"--{group}.{word[2:]}" if word.startswith("--") else word


def one_sentence(error: Exception) -> str:
    """What a validation error says, on one line, without the library's own advertising."""
    if isinstance(error, ValidationError):
        return "; ".join(_describe(detail) for detail in error.errors())
    kept = [line.strip() for line in str(error).splitlines() if "errors.pydantic.dev" not in line]
    return " ".join(" ".join(kept).replace("config.", "").split())


def _describe(detail: Any) -> str:
    where = ".".join(str(part) for part in detail["loc"]) or "configuration"
    message = detail["msg"].removeprefix("Value error, ")
    if detail["type"] == "extra_forbidden":
        return f"unknown key {where}"
    return f"{where}: {message}, got {detail['input']!r}" if detail["loc"] else message


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
        raise ConfigError(one_sentence(error)) from None


def _overlay(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    result = dict(base)
    for key, value in changes.items():
        nested = isinstance(value, Mapping) and isinstance(result.get(key), Mapping)
        result[key] = _overlay(result[key], value) if nested else value
    return result
