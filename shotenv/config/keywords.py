"""Keyword arguments of an environment to its configuration: plain JSON values to `EnvConfig`.

A vector of environments reads the same few files again and again: the last 32 are kept for the life
of the process, and read anew when they change on disk (`_read_version`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from shotenv.config.env import EnvConfig
from shotenv.config.laser import LaserConfig
from shotenv.config.reader import ConfigError, find_config, merged, read_config
from shotenv.config.sensor import SensorConfig
from unwrap.support import Section, in_short

SECTIONS: Mapping[str, type[Section]] = {"sensor": SensorConfig, "laser": LaserConfig}
"""Fields of `EnvConfig` that have a folder of files in `configs/`."""


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
    >>> env_config(reward={"duty": 0.2}).reward.duty
    0.2
    """
    # A named file replaces the whole section, a mapping changes single values of the base's.
    base = _read(EnvConfig, "env", "config", config)
    changes = dict(fields)
    for name, model in SECTIONS.items():
        if name in fields and not isinstance(fields[name], Mapping):
            changes[name] = _read(model, name, name, fields[name]).model_dump()
    return merged(base, changes)


def _read(model: type[Section], section: str, keyword: str, value: Any) -> Any:
    """The section in the file that `value` names, which was given for `keyword`."""
    if not isinstance(value, str | Path):
        raise ConfigError(
            f"{keyword} is {in_short(value)}; expected a name, a path or a mapping of values"
        )
    path = find_config(section, str(value))
    return _read_version(model, path, path.stat().st_mtime_ns)


@lru_cache(maxsize=32)
def _read_version(model: type[Section], path: Path, changed_ns: int) -> Section:
    """The section in `path` as it was written at `changed_ns`."""
    return read_config(model, path)
