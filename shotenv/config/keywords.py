"""Keyword arguments of an environment to its configuration."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from shotenv.config.env import EnvConfig
from shotenv.config.laser import LaserConfig
from shotenv.config.reader import ConfigError, find_config, merged, read_config
from shotenv.config.sensor import SensorConfig
from unwrap.support import Section

SECTIONS: Mapping[str, type[Section]] = {"sensor": SensorConfig, "laser": LaserConfig}


def env_config(config: str = "default", **fields: Any) -> EnvConfig:
    """Configuration of an environment from plain JSON values.

    Parameters
    ----------
    config
        Name in `configs/env/`, or path of a YAML file, that `fields` change.
    **fields
        Fields of `EnvConfig`. `sensor` and `laser` are a name, a path, or a mapping that changes
        single values; `reward` is a mapping.

    Raises
    ------
    ConfigError
        An unknown field or file, a wrong type or a value out of range; the message names it.

    Examples
    --------
    >>> env_config(reward={"power": 0.2}).reward.power
    0.2
    """
    base = _read(EnvConfig, find_config("env", _text("config", config)))
    return merged(base, {name: _plain(name, value) for name, value in fields.items()})


def _plain(name: str, value: Any) -> Any:
    if name not in SECTIONS or isinstance(value, Mapping):
        return value
    path = find_config(name, _text(name, value))
    return _read(SECTIONS[name], path).model_dump()


def _text(name: str, value: Any) -> str:
    if isinstance(value, str | Path):
        return str(value)
    raise ConfigError(f"{name} is {value!r}; expected a name, a path or a mapping of values")


@lru_cache(maxsize=32)
def _read_version(model: type[Section], path: Path, changed_ns: int) -> Section:
    return read_config(model, path)


def _read(model: type[Section], path: Path) -> Any:
    return _read_version(model, path, path.stat().st_mtime_ns)
